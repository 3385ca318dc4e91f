"""The commands by which results travel, as a user gives them."""

from __future__ import annotations

import pytest

from benchmarks import __main__ as commands
from benchmarks.cases.builtin import BUILTIN
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
