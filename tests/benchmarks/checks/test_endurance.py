"""Short forms of `python -m benchmarks.checks.endurance`: kills and faults cost no row."""

from __future__ import annotations

import subprocess
import sys

from benchmarks.checks import bystanders, endurance, faulty
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


def test_methods_that_go_wrong_cost_their_own_cells(tmp_path, monkeypatch, capsys):
    faults = {name: faulty.FAULTS[name] for name in ("segfault", "breed", "kill_the_supervisor")}
    monkeypatch.setattr(faulty, "FAULTS", faults)
    found = endurance.saved(tmp_path / "models", tmp_path / "one", 1)
    assert (found.reported, found.faults) == (2 * (3 + 2), 0)
    monkeypatch.setattr(faulty, "FAULTS", {"quit": (lambda: None, "timeout")})
    assert endurance.saved(tmp_path / "models", tmp_path / "two", 1).faults == 2
    assert "in place of timeout" in capsys.readouterr().out


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
