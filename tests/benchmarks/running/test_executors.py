"""Cells on the workers of a cluster: the same rows, whatever becomes of a worker."""

from __future__ import annotations

import itertools
import json
import os
import re
import signal
import stat
import subprocess
import sys
import time
from concurrent.futures import Future
from pathlib import Path

import psutil
import pytest

from benchmarks.cases.suites import Suite
from benchmarks.running import cluster, environment, executors, runner
from benchmarks.running.tasks import MeasureJob, Outcome, Task
from benchmarks.store import measuring, verifying
from benchmarks.store.results import Store
from parapoint.errors import InputError

CASE = "half_cylinder"
PLUGIN = """
import os, sys, time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from parapoint import Parameterization


@dataclass(frozen=True)
class NAME:
    step: int = 1
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface, *, seed):
        Path(NOTES, f"{seed}-{os.getpid()}").touch()
        time.sleep(0.3)
        if seed == 1:
            print("the last words")
            os._exit(3)
        return Parameterization(surface.vertices[:, :2] + np.random.random(), surface.faces)
"""
NUMBERS = itertools.count()
TIMING = ("seconds", "cpu_seconds", "load", "peak_memory_mb", "host", "run")


@pytest.fixture(autouse=True)
def _needs_distributed():
    pytest.importorskip("distributed", reason="the extra `cluster` is not installed")


@pytest.fixture
def slow(tmp_path: Path) -> str:
    name = f"Slow{next(NUMBERS)}"  # plugins stay for the process: each needs a name of its own
    text = PLUGIN.replace("NAME", name).replace("NOTES", repr(str(tmp_path / "notes")))
    (tmp_path / "notes").mkdir()
    (tmp_path / "slow.py").write_text(text)
    return f"{tmp_path}/slow.py:{name}"


@pytest.fixture
def scheduler(tmp_path: Path):
    """A scheduler on this machine: its address, and a function that starts a worker of it."""
    processes = []

    def start(*arguments: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, "-m", *arguments],
            cwd=environment.ROOT,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        processes.append(process)
        return process

    file = tmp_path / "scheduler.json"
    here = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(file)]
    start("distributed.cli.dask_scheduler", *here)
    wait_until(lambda: file.exists() and file.read_text())
    address = json.loads(file.read_text())["address"].removeprefix("tcp://")

    def worker(name: str) -> subprocess.Popen:
        one = ["--no-nanny", "--nthreads", "1", "--no-dashboard", "--name", name]
        folder = ["--local-directory", str(tmp_path / name)]
        return start("distributed.cli.dask_worker", address, *one, *folder)

    yield address, worker
    for process in processes:
        process.kill()
        process.wait()


def wait_until(condition, seconds: float = 60) -> None:
    """Waits for a condition to hold."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def rows(folder: Path) -> list[dict]:
    """Rows of a run by seed, without what takes time."""
    found = sorted(Store(folder).rows(), key=lambda row: row.seed)
    return [{k: v for k, v in vars(row).items() if k not in TIMING} for row in found]


class Killer(runner.Progress):
    """Kills a process once a cell runs below it."""

    def __init__(self, process: subprocess.Popen, notes: Path) -> None:
        self.process = process
        self.notes = notes
        self.seed = -1

    def tick(self) -> None:
        if self.seed >= 0:
            return
        below = {child.pid for child in psutil.Process(self.process.pid).children(recursive=True)}
        for note in self.notes.iterdir():
            seed, pid = map(int, note.name.split("-"))
            if pid in below:
                self.seed = seed
                self.process.send_signal(signal.SIGKILL)
                return


@pytest.mark.long
def test_a_run_on_two_workers_one_of_which_dies_gives_the_rows_of_a_local_one(
    tmp_path, slow, scheduler
):
    address, worker = scheduler
    doomed, _ = worker("doomed"), worker("other")
    suite = Suite("trial", "A trial", (CASE,), (), (0, 1, 2, 3, 4, 5))
    runner.run(suite, tmp_path / "local", plugins=[slow], jobs=2, memory=1)
    for note in (tmp_path / "notes").iterdir():
        note.unlink()
    killer = Killer(doomed, tmp_path / "notes")
    summary = runner.run(
        suite,
        tmp_path / "far",
        plugins=[slow],
        executor=f"dask://{address}",
        jobs=2,
        memory=1,
        progress=killer,
    )
    assert killer.seed >= 0
    begun = [note.name.partition("-")[0] for note in (tmp_path / "notes").iterdir()]
    assert begun.count(str(killer.seed)) == 2  # once again, and no more
    assert rows(tmp_path / "far") == rows(tmp_path / "local")
    assert [row.status for row in summary.ran].count("ok") == 5
    failed = next(row for row in summary.ran if row.seed == 1)
    assert failed.reason == "ended the process (exit status 3) with no result"
    assert failed.output == "the last words"
    assert all(environment.processor() in row.host for row in summary.ran)
    assert not list(verifying.faults(Store(tmp_path / "far")))
    assert len(measuring.metrics(Store(tmp_path / "far"))["angle_difference_mean"].dropna()) == 5
    # The killed worker's cell has ended with it.
    cells = [int(note.name.split("-")[1]) for note in (tmp_path / "notes").iterdir()]
    wait_until(lambda: not any(psutil.pid_exists(cell) for cell in cells))


class Workers:
    """A client of a cluster whose workers do each task at once, in this process."""

    def submit(self, function, *arguments, modules, **_):
        future: Future = Future()
        try:
            future.set_result(function(*arguments, modules=modules))
        except InputError as error:
            future.set_exception(error)
        return future


def test_a_worker_of_another_version_ends_the_run_in_words(tmp_path, monkeypatch):
    import distributed

    monkeypatch.setattr(distributed, "wait", lambda *_, **__: None)
    remote = cluster.Remote(lambda _: Workers(), tmp_path / "scratch", 1, lambda: None)
    remote.project = "another"
    surface = tmp_path / "surface.npz"
    surface.touch()
    ended = []
    job = MeasureJob(surface=surface, time_limit=1, memory_limit=1, maps=())
    task = Task(job, lambda: None, lambda *outcome: ended.append(outcome))
    with remote, pytest.raises(InputError, match="has another version of the project"):
        remote.run([task], 1)
    assert not ended


def test_a_cell_that_lost_two_workers_runs_again_next_time(tmp_path, monkeypatch):
    suite = Suite("trial", "A trial", (CASE,), ("tutte",), (0,))

    class Lost(executors.Local):
        def run(self, tasks, _):
            for task in tasks:
                task.ended(Outcome("failed", cluster.WORKER_LOST), Path())

    with monkeypatch.context() as patch:
        patch.setattr(executors, "Local", Lost)
        assert [row.status for row in runner.run(suite, tmp_path).ran] == ["failed"]
        assert dict(runner.run(suite, tmp_path).reasons) == {"workers were lost": 1}


@pytest.mark.parametrize(
    ("name", "memory", "says"),
    [
        ("nonsense", 1, "there are local, dask://HOST:PORT, dask+tls://HOST:PORT"),
        ("dask://", 1, "there are local"),
        ("dask://127.0.0.1:9", None, "--memory"),
    ],
)
def test_a_wrong_executor_is_said_before_anything_is_written(tmp_path, name, memory, says):
    suite = Suite("trial", "A trial", (CASE,), ("tutte",), (0,))
    with pytest.raises(InputError, match=re.escape(says)):
        runner.run(suite, tmp_path / "out", executor=name, memory=memory)
    assert not (tmp_path / "out").exists()


def test_a_missing_package_is_said_with_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setattr(executors.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(InputError, match=r"pip install -e '\.\[bench,cluster\]'"):
        executors.executor("slurm", tmp_path, jobs=1, memory=1, tick=lambda: None)


def test_slurm_alone_needs_the_package_that_talks_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        executors.importlib.util, "find_spec", lambda name: None if "jobqueue" in name else name
    )
    with pytest.raises(InputError, match="the executor slurm needs the package dask_jobqueue"):
        executors.executor("slurm", tmp_path, jobs=1, memory=1, tick=lambda: None)
    executors.executor("dask://here:1", tmp_path, jobs=1, memory=1, tick=lambda: None)


def test_a_scheduler_that_does_not_answer_is_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_SECONDS", 0.2)
    hands = executors.executor("dask://127.0.0.1:9", tmp_path, jobs=1, memory=1, tick=lambda: None)
    with pytest.raises(InputError, match="no dask scheduler answers"), hands:
        pass


def test_slurm_is_asked_for_the_right_jobs_and_they_do_the_cells(tmp_path, slow, monkeypatch):
    """No Slurm here: `sbatch` is a stand-in that keeps the job's script, and runs it."""
    pytest.importorskip("dask_jobqueue")
    submitted = tmp_path / "submitted"
    submitted.mkdir()
    for name, text in {
        "sbatch": f'cp "$1" {submitted}/$$.sh; bash {submitted}/$$.sh >/dev/null 2>&1 &\necho $!',
        "scancel": 'for id in "$@"; do pkill -P "$id"; kill "$id"; done 2>/dev/null; true',
    }.items():
        (tmp_path / name).write_text(f"#!/bin/bash\n{text}\n")
        (tmp_path / name).chmod(stat.S_IRWXU)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.chdir(environment.ROOT)
    suite = Suite("trial", "A trial", (CASE,), (), (0, 1, 2))
    summary = runner.run(
        suite, tmp_path / "out", plugins=[slow], executor="slurm", jobs=2, memory=1
    )
    assert {row.seed: row.status for row in summary.ran} == {0: "ok", 1: "failed", 2: "ok"}
    scripts = [path.read_text() for path in submitted.iterdir()]
    assert len(scripts) == 2
    for script in scripts:
        assert "#SBATCH --mem=3G" in script
        assert "#SBATCH --cpus-per-task=1" in script
        assert re.search(r"--nthreads 1\b(?!.*--nthreads)", script)
