"""What a cell finds around it on this machine, and what becomes of supervisors that go wrong."""

from __future__ import annotations

import os
import random
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.cases.suites import Suite
from benchmarks.running import executors, local, runner, scoring, scratch
from benchmarks.running.local import Local
from benchmarks.running.tasks import MeasureJob, Outcome, Ready, Task, to_json
from benchmarks.store.results import Store
from parapoint.errors import InputError

PLUGIN = """
import os, random, time
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
from benchmarks.running import cell
from parapoint import Parameterization


@dataclass(frozen=True)
class Curious:
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface, *, seed):
        print("seed", seed)
        if seed == 3:
            print("x" * 900, "end")
            raise ValueError("no")
        folder = Path.cwd().parent
        report = {
            "random": random.random(),
            "numpy": np.random.random(),
            "hashes": os.environ["PYTHONHASHSEED"],
            "threads": os.environ["OPENBLAS_NUM_THREADS"],
            "waiting": os.environ["OMP_WAIT_POLICY"],
            "is_temporary_folder": os.environ["TMPDIR"] == str(Path.cwd()),
            "work": sorted(path.name for path in Path.cwd().iterdir()),
            "cells": sorted(path.name == folder.name for path in folder.parent.iterdir()),
        }
        return Parameterization(surface.vertices[:, :2], surface.faces, report=report)


@dataclass(frozen=True)
class Parent:
    notes: str = ""
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface, *, seed):
        write = cell.write_arrays

        def noted(*arguments):
            with open(self.notes, "a") as stream:
                stream.write(f"{os.getpid()}\\n")
            write(*arguments)

        cell.write_arrays = noted
        child = os.fork()
        if child:
            os.waitpid(child, 0)
        else:
            end = time.process_time() + 0.4
            while time.process_time() < end:
                pass
        return Parameterization(surface.vertices[:, :2], surface.faces)
"""
CURIOUS = Suite("trial", "A trial", ("cone",), ("curious",), (0, 2**32 - 1, 3))


@pytest.fixture(scope="module")
def curious(tmp_path_factory):
    """Rows, by seed, of a method that looks around."""
    folder = tmp_path_factory.mktemp("curious")
    (folder / "plugin.py").write_text(PLUGIN)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OMP_NUM_THREADS", "3")
        patch.setattr(runner, "_measure", lambda *_: None)
        patch.setattr(local, "OUTPUT_KEPT", 600)
        plugins = [f"{os.path.relpath(folder)}/plugin.py:Curious"]
        runner.run(CURIOUS, folder / "out", plugins=plugins, jobs=1)
    return {row.seed: row for row in Store(folder / "out").rows()}


def test_a_cell_has_its_own_empty_folder_and_set_variables(curious):
    for seed in (0, 2**32 - 1):
        report = curious[seed].report
        assert report["hashes"] == "0"
        assert report["threads"] == "3"
        assert report["waiting"] == "passive"
        assert report["is_temporary_folder"] is True
        assert report["work"] == []
        # The folder of the cell before is gone; the mark is no cell.
        assert report["cells"] == [False, True]


def test_generators_that_a_method_forgot_to_seed_are_seeded(curious):
    for seed in (0, 2**32 - 1):
        report = curious[seed].report
        assert report["random"] == random.Random(seed).random()  # noqa: S311  not for secrets
        assert report["numpy"] == np.random.RandomState(seed).random_sample()


def test_what_is_printed_is_kept_of_the_cell_alone_and_bounded(curious):
    rows = curious
    assert rows[0].output == rows[2**32 - 1].output == ""
    assert 500 < len(rows[3].output) <= 600
    assert rows[3].output.endswith("ValueError: no")


def test_the_output_of_the_cell_before_does_not_count(tmp_path, monkeypatch):
    (tmp_path / "plugin.py").write_text(PLUGIN.replace("Curious", "Loud").replace('"x" * 900', "1"))
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    suite = Suite("trial", "A trial", ("cone",), ("loud",), (0, 3))
    (_, row) = runner.run(suite, tmp_path / "out", plugins=[f"{tmp_path}/plugin.py:Loud"]).ran
    assert row.output.startswith("seed 3\n")


def test_the_time_of_methods_is_theirs_or_that_of_the_whole_cell_where_they_fail(
    tmp_path, monkeypatch
):
    known = [Outcome("failed", seconds=1.0, took=9.0), Outcome("failed", took=4.0)]
    outcomes = [*known, Outcome("failed")]  # of the last nobody knows

    class Told(Local):
        def run(self, tasks, _):
            for task, outcome in zip(tasks, outcomes, strict=bool(tasks)):
                task.ended(outcome, Path())

    monkeypatch.setattr(executors, "Local", Told)
    suite = Suite("trial", "A trial", ("cone",), ("tutte",), (0, 1, 2))
    summary = runner.run(suite, tmp_path, jobs=2)
    assert summary.method_seconds == (1 + 4) / 2  # two at a time


def test_a_process_that_a_method_forks_counts_and_writes_no_map(tmp_path, monkeypatch):
    (tmp_path / "plugin.py").write_text(PLUGIN)
    monkeypatch.setattr(runner, "_measure", lambda *_: None)
    suite = Suite("trial", "A trial", ("cone",), (f"parent(notes={str(tmp_path / 'notes')!r})",))
    (row,) = runner.run(suite, tmp_path / "out", plugins=[f"{tmp_path}/plugin.py:Parent"]).ran
    assert row.status == "ok"
    assert row.cpu_seconds > 0.3
    assert len((tmp_path / "notes").read_text().split()) == 1


class FakeSlot:
    """A supervisor that is not there: two pipes, and whatever it is made to say."""

    def __init__(self, _: int, interpreter: str, modules: tuple[str, ...]) -> None:
        self.interpreter, self.modules = interpreter, modules
        (self.replies, self.voice), (self.output, self.printer) = os.pipe(), os.pipe()
        os.set_blocking(self.replies, False)
        os.set_blocking(self.output, False)
        self.reply, self.printed = bytearray(), bytearray()
        self.ready, self.task, self.folder, self.started = False, None, None, 0.0
        self.begun: list[Task] = []
        self.time_limit, self.number = 1e9, 0
        self.process = SimpleNamespace(pid=0)

    hear, drain = local._Slot.hear, local._Slot.drain

    def begin(self, task: Task, folder: Path) -> None:
        self.begun.append(task)
        self.folder = folder

    def says(self, line: bytes) -> None:
        os.write(self.voice, line)

    def close(self) -> None:
        for pipe in (self.replies, self.output, self.voice, self.printer):
            os.close(pipe)


@pytest.fixture
def hands(tmp_path, monkeypatch):
    monkeypatch.setattr(local, "_Slot", FakeSlot)
    with Local(tmp_path / scratch.NAME, 1, lambda: None) as hands:
        yield hands


def task(
    outcomes: list[Outcome], modules: tuple[str, ...] = (), interpreter: str = sys.executable
) -> Task:
    job = MeasureJob(surface=Path("s"), maps=(Path("u"),), time_limit=9.0, memory_limit=1e9)
    return Task(
        job, lambda: None, lambda outcome, _: outcomes.append(outcome), modules, interpreter
    )


def test_a_supervisor_does_tasks_of_its_own_modules_and_interpreter_only(hands):
    outcomes: list[Outcome] = []
    here = sys.executable
    kinds = [((), here), (("torch",), here), ((), "other/python"), ((), here), ((), "other/python")]
    for modules, interpreter in kinds:
        hands._assign(task(outcomes, modules, interpreter))
        (slot,) = [slot for slot in hands.slots if slot.task is not None]
        assert (slot.modules, slot.interpreter) == (modules, interpreter)
        if not slot.ready:
            slot.says(to_json(Ready()))
            hands._listen()
        slot.says(to_json(Outcome("ok", number=hands.sent)))
        hands._listen()
    assert len(hands.slots) == 3
    assert [outcome.status for outcome in outcomes] == ["ok"] * 5


def test_an_outcome_counts_only_once_the_supervisor_is_ready(hands):
    outcomes: list[Outcome] = []
    hands._assign(task(outcomes))
    (slot,) = hands.slots
    slot.says(to_json(Outcome("ok")))
    hands._listen()
    assert outcomes == slot.begun == []
    slot.says(to_json(Ready()))
    hands._listen()
    assert len(slot.begun) == 1


@pytest.mark.parametrize("line", [b"{}\n", b"\xff\n", b'["Outcome", {"status": "fine"}]\n'])
def test_a_supervisor_that_answers_nonsense_costs_its_task_and_is_replaced(hands, line):
    outcomes: list[Outcome] = []
    hands._assign(task(outcomes))
    (slot,) = hands.slots
    slot.says(to_json(Ready()))
    hands._listen()
    slot.says(line)
    hands._listen()
    (outcome,) = outcomes
    assert outcome.status == "failed"
    assert outcome.reason.startswith("the process that watched over it answered nonsense")
    assert not hands.slots
    hands._assign(task(outcomes))
    assert len(hands.slots) == 1


def test_the_answer_to_another_task_is_none(hands):
    outcomes: list[Outcome] = []
    hands._assign(task(outcomes))
    (slot,) = hands.slots
    slot.says(
        to_json(Ready()) + to_json(Outcome("ok", number=0)) + to_json(Outcome("ok", number=2))
    )
    hands._listen()
    assert outcomes == []
    slot.says(to_json(Outcome("failed", number=1)) + to_json(Outcome("ok", number=1)))
    hands._listen()
    assert [outcome.status for outcome in outcomes] == ["failed"]


def test_a_line_without_an_end_costs_the_task_and_no_memory(hands, monkeypatch):
    outcomes: list[Outcome] = []
    monkeypatch.setattr(local, "LONGEST_LINE", 1000)
    hands._assign(task(outcomes))
    (slot,) = hands.slots
    slot.says(to_json(Ready()))
    hands._listen()
    slot.says(b"x" * 1001)
    hands._listen()
    assert "answered nonsense: a line is too long" in outcomes[0].reason


def test_a_supervisor_that_ends_between_two_tasks_is_replaced(hands):
    outcomes: list[Outcome] = []
    hands._assign(task(outcomes))
    (slot,) = hands.slots
    slot.says(to_json(Ready()))
    hands._listen()
    slot.says(to_json(Outcome("ok", number=1)))
    hands._listen()
    hands._lost(slot, "killed")
    assert not hands.slots
    assert [outcome.status for outcome in outcomes] == ["ok"]


def test_a_supervisor_that_never_starts_ends_the_run_in_one_line(hands):
    hands._assign(task([]))
    for _ in range(local.MOST_STARTS - 1):
        (slot,) = hands.slots
        hands._lost(slot, "")
    (slot,) = hands.slots
    slot.printed += b"no such module\n"
    with pytest.raises(InputError, match="no process can be started for a cell: no such module"):
        hands._lost(slot, "")


def test_the_memory_of_the_machine_is_shared_by_the_jobs(monkeypatch):
    monkeypatch.setattr(runner.environment, "memory", lambda: 1000)
    assert scoring.memory_limit(None, 4) == 200
    assert scoring.memory_limit(2.5, 4) == 2.5e9
