"""What harms a cell from outside, and what a cell leaves behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import psutil
import pytest

from benchmarks.cases.suites import Suite
from benchmarks.checks import instant
from benchmarks.running import planning, runner
from benchmarks.running.runner import Progress, run
from benchmarks.store.results import Store
from benchmarks.store.rows import MACHINE, WATCHER_KILLED

PLUGIN = f"{instant.__file__}:Instant"
TAG = "tag-of-a-descendant"
SCATTER = f"""
    import os, subprocess, sys, time
    from dataclasses import dataclass
    from typing import ClassVar

    WAYS = {{
        "child": dict(),
        "own session": dict(start_new_session=True),
        "no variables": dict(start_new_session=True, env={{}}),
        "other folder": dict(start_new_session=True, cwd="/", env={{}}),
    }}

    @dataclass(frozen=True)
    class Scatter:
        requires: ClassVar[frozenset[str]] = frozenset({{"faces"}})

        def parameterize(self, surface, *, seed):
            for options in WAYS.values():
                if not os.fork():  # the parent of each is gone at once
                    command = [sys.executable, "-c", "import time; time.sleep(600)", "{TAG}"]
                    subprocess.Popen(command, **options)
                    os._exit(0)
            time.sleep(0.5)
            open(os.environ["NOTES"], "w").write(f"{{os.getppid()}} {{os.getpid()}}")
            time.sleep(600)
    """


def tagged() -> list[psutil.Process]:
    """The processes that carry the tag."""
    found = []
    for process in psutil.process_iter():
        try:
            if TAG in process.cmdline():
                found.append(process)
        except psutil.Error:
            continue
    return found


def suite(*cases: str) -> Suite:
    return Suite("trial", "A trial", cases, (), (0,))


@pytest.mark.parametrize("victim", ["run", "supervisor", "cell"])
def test_all_descendants_end_with_whatever_is_killed(victim: str, tmp_path: Path) -> None:
    """Whatever they do with their session, variables and folder; nothing is left after 5 s."""
    plugin, notes = tmp_path / "scatter.py", tmp_path / "notes"
    plugin.write_text(textwrap.dedent(SCATTER))
    command = [sys.executable, "-m", "benchmarks", "run", "--cases", "half_cylinder"]
    options = [
        "--plugin",
        f"{plugin}:Scatter",
        "--methods",
        "scatter",
        "--out",
        str(tmp_path / "o"),
    ]
    variables = os.environ | {"NOTES": str(notes)}
    process = subprocess.Popen(
        [*command, *options], env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    deadline = time.monotonic() + 60
    while not (notes.exists() and notes.read_text()) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert len(tagged()) == 4
    supervisor, cell = map(int, notes.read_text().split())
    os.kill({"run": process.pid, "supervisor": supervisor, "cell": cell}[victim], signal.SIGKILL)
    deadline = time.monotonic() + 5
    while tagged() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert tagged() == []
    process.communicate(timeout=60)
    if victim != "run":
        assert process.returncode == 0
        (row,) = Store(tmp_path / "o").rows()
        assert row.status == "failed"
        killed = {"supervisor": WATCHER_KILLED, "cell": "killed by SIGKILL (killed)"}
        assert row.reason == killed[victim]


class Killer(Progress):
    """Kills all supervisors between two cells."""

    def ended(self, cell, row) -> None:  # noqa: ARG002  as its base
        for child in psutil.Process().children():
            with contextlib.suppress(psutil.Error):  # one that was killed before
                if "benchmarks.running.worker" in child.cmdline():
                    child.kill()


def test_a_supervisor_that_is_killed_while_idle_costs_no_other_cell(tmp_path: Path) -> None:
    run(suite("half_cylinder", "swiss_roll"), tmp_path, plugins=[PLUGIN], progress=Killer())
    rows = Store(tmp_path).rows()
    assert len(rows) == 2
    assert all(row.status == "ok" or row.reason == WATCHER_KILLED for row in rows)
    run(suite("half_cylinder", "swiss_roll"), tmp_path, plugins=[PLUGIN])
    assert [row.status for row in Store(tmp_path).rows()] == ["ok", "ok"]


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:200] + bytes([data[200] ^ 1]) + data[201:],
        lambda data: data[: len(data) // 2],
        lambda _: b"",
    ],
    ids=["one bit", "half", "empty"],
)
def test_a_damaged_surface_is_no_failure_of_the_method(damage, tmp_path: Path, monkeypatch) -> None:
    """The row says so, and the next run stores the surface anew and runs the cell."""
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    run(suite("half_cylinder"), tmp_path, plugins=[PLUGIN], seeds=[0])
    (path,) = (tmp_path / "surfaces").iterdir()
    whole = path.read_bytes()
    path.write_bytes(damage(whole))
    monkeypatch.setattr(planning.Store, "add_surface", lambda *_: path.stem)  # it stays damaged
    run(suite("half_cylinder"), tmp_path, plugins=[PLUGIN], seeds=[1])
    monkeypatch.undo()
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    row = Store(tmp_path).rows()[-1]
    assert row.status == "failed"
    assert row.reason.startswith(MACHINE)
    summary = run(suite("half_cylinder"), tmp_path, plugins=[PLUGIN], seeds=[1])
    assert summary.reasons == {"machine failed": 1}
    assert [row.status for row in Store(tmp_path).rows()] == ["ok", "ok"]
    assert Store(tmp_path).is_whole(path.stem)
