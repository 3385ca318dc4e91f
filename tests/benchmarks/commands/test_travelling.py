"""The commands by which results travel, as a user gives them."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import __main__ as commands
from benchmarks.cases.builtin import BUILTIN
from benchmarks.commands import travelling
from benchmarks.store.recomputing import Verified
from benchmarks.store.results import Store
from parapoint import console


def command(*arguments: str) -> int:
    """The exit status of a command, run in this process."""
    with pytest.raises(SystemExit) as ended:
        console.run(commands.main, list(arguments))
    return int(ended.value.code or 0)


def obj(mesh) -> str:
    lines = ["v {} {} {}".format(*point) for point in mesh.vertices]
    lines += ["vt {} {}".format(*point[:2]) for point in mesh.vertices]
    lines += ["f {0}/{0} {1}/{1} {2}/{2}".format(*face) for face in mesh.faces + 1]
    return "\n".join(lines) + "\n"


def test_a_submission_is_scored_published_verified_and_merged(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "saddle.obj").write_text(obj(BUILTIN["saddle"]()))
    submit = ["submit", "maps", "--method", "My tool", "--suite", "builtin", "--out", "out"]
    assert command(*submit) == 0
    said = capsys.readouterr().out
    assert "out: 1 maps of My tool\n" in said
    assert "missing: 9 of 10 cases: half_cylinder, cone" in said
    assert "report: python -m reports out\n" in said
    assert (tmp_path / "out" / "metrics.parquet").is_file()
    rows = Store("out").rows()
    assert command(*submit) == 0  # once more: the same rows
    assert Store("out").history() == rows
    assert command("run", "builtin", "--cases", "saddle", "--methods", "lscm", "--out", "out") == 0
    capsys.readouterr()

    assert command("publish", "out") == 0
    assert "11 rows, 2 maps" in capsys.readouterr().out
    assert command("verify", "out.zip") == 0
    assert "out.zip: 11 rows, 2 maps, " in (shown := capsys.readouterr().out)
    assert "no differences" in shown
    assert command("merge", "out.zip", "out", "--out", "both") == 0
    assert "both: 11 rows, 11 of them in several alike" in capsys.readouterr().out
    assert command("check", "both") == 0

    changed = bytearray((tmp_path / "out.zip").read_bytes())
    changed[len(changed) // 2] ^= 1
    (tmp_path / "out.zip").write_bytes(changed)
    capsys.readouterr()
    assert command("verify", "out.zip") == 2
    assert capsys.readouterr().err == (
        "error: out.zip: has been changed since it was published: its seal is broken\n"
    )


@pytest.mark.parametrize(
    "arguments",
    [
        ["publish", "missing"],
        ["merge", "a", "b"],
        ["merge", "--out", "c"],
        ["merge", "a", "b", "--out", "c"],
        ["verify", "missing.zip"],
        ["submit", "missing", "--method", "x", "--out", "o"],
        ["submit", ".", "--method", "x", "--out", "o"],
        ["submit", ".", "--method", "", "--out", "o"],
        ["submit", ".", "--method", "x", "--suite", "none", "--out", "o"],
    ],
)
def test_wrong_use_is_one_line_and_writes_nothing(arguments, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert command(*arguments) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("error: ")
    assert shown.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, ["no differences"]),
        (1, ["1 difference"]),
        (22, ["and 2 more differences", "22 differences"]),
    ],
)
def test_the_status_says_whether_anything_differs(
    count: int, said: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = Verified(rows=3, maps=2, values=9, faults=[f"fault {n}" for n in range(count)])
    monkeypatch.setattr(travelling.recomputing, "verify", lambda *_: found)
    assert command("verify", "x.zip") == bool(count)
    faults = [f"fault {n}" for n in range(min(count, 20))]
    said[-1] = f"x.zip: 3 rows, 2 maps, 9 values computed anew: {said[-1]}"
    assert capsys.readouterr().out.splitlines() == [*faults, *said]


def test_the_measuring_of_maps_is_told_every_ten_seconds_and_at_its_end(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = iter([0.0, 0.0, 9.0, 10.0, 19.0, 21.0, 22.0])
    monkeypatch.setattr(travelling.time, "monotonic", lambda: next(now))
    told = travelling._Told()
    told(0, 0)  # nothing to measure
    for done in (1, 2, 3, 4, 5):
        told(done, 5)
    assert capsys.readouterr().err.splitlines() == [
        "measured 2/5 (0:00:10)",
        "measured 4/5 (0:00:21)",
        "measured 5/5 (0:00:22)",
    ]


def test_a_merge_tells_which_answers_stay_and_what_is_older_than_versions(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    found = travelling.merging.Merged(
        rows=4, same=2, contested=["cone, slim, seed 0: b"], unversioned={"paper": 3}
    )
    monkeypatch.setattr(travelling.merging, "merge", lambda *_: found)
    assert command("merge", "a", "b", "--out", "c") == 0
    assert capsys.readouterr().out.splitlines() == [
        "c: 4 rows, 2 of them in several alike",
        "the first answer stays: cone, slim, seed 0: b has another",
        "3 rows of paper are older than versions of suites: theirs is not known",
        "report: python -m reports c",
    ]


def test_rows_of_own_files_are_counted_as_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def publish(_: Path, archive: Path) -> travelling.publishing.Published:
        archive.write_bytes(bytes(1_500_000))
        return travelling.publishing.Published(3, 2, 1)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(travelling.publishing, "publish", publish)
    assert command("publish", "out") == 0
    assert capsys.readouterr().out.splitlines() == [
        f"{tmp_path}/out.zip: 3 rows, 2 maps, 1.5 MB",
        "left out: 1 rows of files that are not public",
        f"check it: python -m benchmarks verify {tmp_path}/out.zip",
    ]
