"""Short forms of `python -m benchmarks.checks.endurance`: kills and faults cost no row."""

from __future__ import annotations

import itertools
import random
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner

from benchmarks.cases.suites import Suite
from benchmarks.checks import bystanders, endurance, faulty, hardships
from benchmarks.running.environment import ROOT
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity

KILLS = """
import sys
from pathlib import Path
from benchmarks.checks import bystanders, endurance, faulty
folder = Path(sys.argv[1])
suite = endurance.instant_suite(folder / "models", models=2, methods=1, seeds=2)
print(endurance.toll(suite, folder, count=2, seed=1))
"""


@pytest.mark.long
def test_runs_that_are_killed_end_in_the_table_of_one_that_was_not(tmp_path):
    # In a process of its own: it forks, which a test runner with threads must not.
    command = [sys.executable, "-c", KILLS, str(tmp_path)]
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert "kills=2" in said
    assert said.rstrip().endswith("faults=0)")
    assert "tables=0" not in said


def test_a_row_that_is_lost_or_damaged_is_a_fault(tmp_path, capsys):
    store = Store(tmp_path)
    rows = []
    for seed in (0, 1):
        cell = {"suite": "s", "case": "c", "method": "m", "params": {}, "seed": seed}
        cell |= {"source_hash": "abc", "surface_hash": ""}
        rows.append(ResultRow(id=identity(**cell), status="failed", **cell))
    with store.writing():
        for row in rows:
            store.append(row)
    reported = {row.id for row in rows}
    found = endurance.Toll()
    endurance._check(store, reported, found)
    assert found.faults == 0
    lines = (tmp_path / "runs.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "runs.jsonl").write_bytes(lines[0])
    endurance._check(store, reported, found)
    assert "1 rows that were reported are gone" in capsys.readouterr().out
    (tmp_path / "runs.jsonl").write_bytes(lines[0][:50] + b"\n" + lines[1])
    endurance._check(store, set(), found)
    assert "line 1: no whole row" in capsys.readouterr().out
    assert found.faults == 2


@pytest.mark.long
def test_methods_that_go_wrong_cost_their_own_cells(tmp_path, monkeypatch, capsys):
    faults = {name: faulty.FAULTS[name] for name in ("segfault", "breed", "kill_the_supervisor")}
    monkeypatch.setattr(faulty, "FAULTS", faults)
    found = endurance.saved(tmp_path / "models", tmp_path / "one", 1)
    assert (found.reported, found.faults) == (2 * (3 + 2), 0)
    monkeypatch.setattr(faulty, "FAULTS", {"quit": (lambda: None, "timeout")})
    assert endurance.saved(tmp_path / "models", tmp_path / "two", 1).faults == 2
    assert "in place of timeout" in capsys.readouterr().out


@pytest.mark.long
def test_commands_leave_the_files_of_the_user(tmp_path):
    found = bystanders.undisturbed(tmp_path / "folder", count=2, seed=3)
    assert found.faults == []
    assert found.runs == 2
    assert found.files > 25


def test_a_file_that_changes_is_found(tmp_path, monkeypatch):
    wrong = "import pathlib, sys; pathlib.Path(sys.argv[1], 'mine', 'lock').write_text('ours')"
    monkeypatch.setattr(bystanders, "NAMES", ("lock", "a", "b", "c"))
    monkeypatch.setattr(bystanders, "COMMANDS", ("parapoint",))

    def status(_, folder):
        if (folder / "mine" / "lock").exists():
            return subprocess.call([sys.executable, "-c", wrong, str(folder)])
        return 0

    monkeypatch.setattr(bystanders, "inputs", lambda at: (at / "results").mkdir(parents=True) or {})
    monkeypatch.setattr(bystanders, "_status", status)
    found = bystanders.undisturbed(tmp_path / "folder", count=6, seed=0)
    assert found.faults
    assert all("lock was changed" in fault for fault in found.faults)


@pytest.mark.parametrize(
    ("status", "command", "fault"),
    [
        (0, "benchmarks list cases", False),
        (2, "benchmarks list cases", False),
        (1, "benchmarks list cases", True),
        (3, "benchmarks list cases", True),
        (1, "benchmarks check {folder}", False),
    ],
)
def test_a_command_may_refuse_and_only_a_check_may_find_faults(
    status: int, command: str, fault: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def inputs(at: Path) -> dict[str, Path]:
        (at / "results").mkdir(parents=True)
        return {}

    monkeypatch.setattr(bystanders, "inputs", inputs)
    monkeypatch.setattr(bystanders, "COMMANDS", (command,))
    monkeypatch.setattr(bystanders, "_status", lambda *_: status)
    found = bystanders.undisturbed(tmp_path, count=2, seed=0)
    assert (found.runs, found.refused) == (2, 2 * (status == 2))
    assert len(found.faults) == 2 * fault
    assert all(f"ended with status {status}" in text for text in found.faults)


def test_the_models_of_a_suite_are_as_many_as_asked_for_and_differ(tmp_path: Path) -> None:
    suite = endurance.instant_suite(tmp_path / "models", models=3, methods=2, seeds=4)
    assert len({Path(case).read_text() for case in suite.cases}) == len(suite.cases) == 3
    assert suite.methods == ("instant(variant=0)", "instant(variant=1)")
    assert suite.seeds == (0, 1, 2, 3)


@pytest.mark.parametrize("faults", [0, 2])
@pytest.mark.parametrize("command", ["kills", "faults"])
def test_the_status_of_a_command_says_whether_there_were_faults(
    command: str, faults: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def toll(suite: Suite, *_: object, count: int, seed: int) -> endurance.Toll:
        assert (len(suite.cases), len(suite.methods), len(suite.seeds), seed) == (4, 2, 4, 3)
        return endurance.Toll(count, tables=1, reported=5, faults=faults)

    monkeypatch.setattr(endurance, "toll", toll)
    monkeypatch.setattr(endurance, "saved", lambda *_: endurance.Toll(reported=5, faults=faults))
    asked = ["kills", "--count", "7", "--seed", "3"] if command == "kills" else ["faults"]
    ended = CliRunner().invoke(endurance.main, asked)
    assert ended.exit_code == bool(faults)
    assert f"{faults or 'no'} faults" in ended.output
    assert ("7 kills in 0 s, 5 rows" if command == "kills" else "5 cells") in ended.output


HARDSHIPS = ("kills", "broken_off", "disks", "rows")


@pytest.mark.parametrize("faulty_part", [None, "toll", "saved", "undisturbed", *HARDSHIPS])
def test_rounds_of_all_checks_go_on_until_time_is_over(
    faulty_part: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ten seconds pass between two rounds: there are two in half a minute, of other seeds each."""
    seeds: list[tuple[str, int]] = []

    def toll(*_: object, count: int, seed: int) -> endurance.Toll:
        seeds.append(("toll", seed))
        return endurance.Toll(count, faults=int(faulty_part == "toll"))

    def undisturbed(_: Path, *, count: int, seed: int) -> bystanders.Count:
        seeds.append(("undisturbed", seed))
        return bystanders.Count(count, 1, 2, ["a fault"] * (faulty_part == "undisturbed"))

    def hardship(name: str) -> Any:
        def check(_: Path, *, seed: int, count: int = 4) -> hardships.Hardship:
            seeds.append((name, seed))
            return hardships.Hardship(count, ["a fault"] * (faulty_part == name))

        return check

    now = itertools.count(0, 10)
    monkeypatch.setattr(endurance, "time", SimpleNamespace(monotonic=lambda: next(now)))
    monkeypatch.setattr(endurance, "toll", toll)
    wrong = endurance.Toll(reported=3, faults=int(faulty_part == "saved"))
    monkeypatch.setattr(endurance, "saved", lambda *_: wrong)
    monkeypatch.setattr(endurance, "undisturbed", undisturbed)
    for name in HARDSHIPS:
        monkeypatch.setattr(hardships, name, hardship(name))
    ended = CliRunner().invoke(endurance.main, ["all", "--minutes", "0.5", "--seed", "7"])
    assert ended.exit_code == (faulty_part is not None)
    assert seeds == [
        (name, seed) for seed in (7, 8) for name in ("toll", "undisturbed", *HARDSHIPS)
    ]
    lines = [line for line in ended.output.splitlines() if line.startswith("round ")]
    counts = [0, 0] if faulty_part is None else [1, 2]
    assert [line.rpartition(": ")[2] for line in lines] == [str(count) for count in counts]
    assert all(f"3 cells of which {2 * len(faulty.FAULTS)} went wrong" in line for line in lines)


def test_what_the_harness_costs_a_cell_is_told_and_the_bytes_of_its_store(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Six cells in three seconds by the clock, and one and a half of processor time."""
    kept: list[int] = []

    def run(suite: Suite, store: Path, *, plugins: list[str], jobs: int) -> SimpleNamespace:
        cells = len(suite.cases) * len(suite.methods) * len(suite.seeds)
        assert (plugins, jobs) == ([endurance.PLUGIN], 2)
        done, kept[:] = kept[:], range(cells)
        (store / "uv").mkdir(parents=True, exist_ok=True)
        (store / "uv" / "map.npz").write_bytes(bytes(600_000))
        return SimpleNamespace(ran=[0] * (cells - len(done)), kept=done)

    now, used = itertools.count(0, 3), itertools.count(0, 1.5)
    monkeypatch.setattr(endurance, "time", SimpleNamespace(monotonic=lambda: next(now)))
    monkeypatch.setattr(endurance, "_processor_seconds", lambda: next(used))
    monkeypatch.setattr(endurance.runner, "run", run)
    asked = ["scale", "--models", "3", "--methods", "2", "--seeds", "1", "--out", str(tmp_path)]
    assert CliRunner().invoke(endurance.main, asked).output.splitlines() == [
        "run: 6 cells after 0: 3.0 s, 1.5 s of processor time",
        "  a cell: 0.5000 s, 0.2500 s",
        "run again: 0 cells after 6: 3.0 s, 1.5 s of processor time",
        "store: 0.6 MB, 100000 bytes a cell",
    ]


def test_what_a_run_adds_to_each_method_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cell takes ten seconds by the clock, of which its method has eight, nine, and so on."""

    def run(suite: Suite, _: str, *, progress: Any) -> None:
        assert {spec.partition("(")[0] for spec in suite.methods} >= {"tutte", "slim", "computed"}
        for seed in suite.seeds:
            for status in ("ok", "failed"):
                progress.started(None)
                row = SimpleNamespace(status=status, method="tutte", seconds=9.0 - seed)
                progress.ended(None, row)

    now = itertools.count(0, 10)
    monkeypatch.setattr(endurance, "time", SimpleNamespace(monotonic=lambda: next(now)))
    monkeypatch.setattr(endurance.runner, "run", run)
    said = CliRunner().invoke(endurance.main, ["overhead", "--cells", "3"]).output
    assert said == "tutte              3 cells  2.000 s, at most 3.000 s\n"


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, None),
        ({"faulty": {"status": "ok"}}, "ok (killed) in place of failed"),
        ({"faulty": {"reason": ""}}, "failed () in place of failed"),
        ({"faulty": {"params": {"fault": "scatter"}}}, "failed (killed) in place of ok"),
        ({"instant": {"uv_sha256": "b" * 64}}, "other maps than those of a run"),
        ({"elsewhere": {}}, "a file outside the cell's folder was changed"),
    ],
)
def test_what_a_method_costs_others_is_told(
    change: dict[str, dict[str, Any]],
    fault: str | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rows: dict[str, dict[str, Any]] = {
        "instant": {"params": {}, "status": "ok", "uv_sha256": "a" * 64},
        "faulty": {"params": {"fault": "segfault"}, "status": "failed", "reason": "killed"},
    }

    def run(suite: Suite, out: Path, **_: object) -> None:
        cell = {"case": "c", "seed": 0, "source_hash": "a", "surface_hash": "", "suite": suite.name}
        is_alone = out.name == "alone"
        store = Store(out)
        with store.writing():
            for method in ("instant",) if is_alone else rows:
                of_row = rows[method] | ({} if is_alone else change.get(method, {}))
                about: dict[str, Any] = {"method": method, **cell, **of_row}
                store.append(ResultRow(id=method[:1].encode().hex() * 8, **about))
        if "elsewhere" in change and not is_alone:
            (out / faulty.ELSEWHERE).mkdir()
            (out / faulty.ELSEWHERE / "map.npz").write_text("ours")

    monkeypatch.setattr(endurance.runner, "run", run)
    monkeypatch.setattr(endurance.verifying, "faults", lambda _: [])
    found = endurance.saved(tmp_path / "models", tmp_path / "out", 1)
    said = capsys.readouterr().out
    assert (found.reported, found.faults) == (2, int(fault is not None))
    assert said == "" if fault is None else fault in said


def test_files_of_a_user_are_added_and_replace_none(tmp_path: Path) -> None:
    draw = random.Random(0)  # noqa: S311  no secret
    (tmp_path / "lock").write_text("ours")
    (tmp_path / "cells").write_text("a file where others would need a folder")
    for _ in range(5):
        before = dict(bystanders.hashes(tmp_path))
        bystanders._fill(tmp_path, draw)
        assert dict(bystanders.hashes(tmp_path)).items() >= before.items()
    names = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    assert len(names) > len(bystanders.NAMES) / 2
    assert names <= {*bystanders.NAMES, "cells"}
