"""Runs cells on the workers of a dask cluster; each worker has supervisors of its own.

A worker need not share a file system with the run: a task carries the content of the files that it
reads, and the answer carries the content of the map. A worker must have the same version of the
project, and of the packages that the project asks for, as the run; if it has not, the run ends with
a line that says so.
"""

from __future__ import annotations

import contextlib
import dataclasses
import socket
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from pathlib import Path
from typing import Any, Self

from benchmarks.running import environment, scratch
from benchmarks.running.local import Local
from benchmarks.running.tasks import MeasureJob, Outcome, RunJob, Task, Tick, from_json, to_json
from benchmarks.store.archives import disk_said, replacing
from parapoint.errors import InputError

CONNECT_SECONDS = 30
"""Seconds that a scheduler may take to answer, and then its first worker to appear."""
WORKER_LOST = "two workers died while they ran it; run again"
"""Reason of a cell whose machines went away; the next run repeats it, and blames no method."""
WORKER_GIGABYTES = 2
"""Memory in GB that a Slurm job gets on top of its cell's, for the worker and the supervisor."""

Client = Any
"""A `distributed.Client`. That package is optional, and half of it has no types."""


class Remote:
    """The executor (`tasks.Executor`) that uses the workers of a dask scheduler."""

    def __init__(
        self,
        connected: Callable[[contextlib.ExitStack], Client],
        folder: Path,
        jobs: int,
        tick: Tick,
    ) -> None:
        """An executor that connects when it is entered.

        Args:
            connected: makes the client, and puts what must be closed after the run on the stack.
            folder: scratch folder of the run on this machine.
            jobs: how many tasks it does at a time.
            tick: called several times a second.
        """
        self.connected = connected
        self.folder = folder
        self.threads = environment.threads(environment.cores())
        self.width = jobs
        self.tick = tick
        self.project = environment.project()
        self.open = contextlib.ExitStack()

    def __enter__(self) -> Self:
        """Connect.

        Raises:
            InputError: no scheduler answers, or it has no worker.
        """
        scratch.clear(self.folder)
        self.client = self.connected(self.open)
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect, and end the workers that the run has started."""
        self.open.close()
        scratch.remove(self.folder)

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, sending `jobs` at a time at most, so that no worker keeps one waiting."""
        import distributed

        wait: Any = distributed.wait
        waiting = deque(tasks)
        running: dict[Any, Task] = {}  # by their futures
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.popleft()
                running[self._sent(task)] = task
                task.began()
            with contextlib.suppress(TimeoutError, CancelledError):
                wait(list(running), timeout=0.1, return_when="FIRST_COMPLETED")
            for future in [future for future in running if future.done()]:
                self._end(running.pop(future), future)
            self.tick()

    def _sent(self, task: Task) -> Any:
        """Send a task to the scheduler, with the content of the files that it reads; its future."""
        plugins = []
        for plugin in task.job.plugins if isinstance(task.job, RunJob) else ():
            path, _, name = plugin.rpartition(":")
            plugins.append((Path(path).name, name, Path(path).read_bytes()))
        inputs = {name: path.read_bytes() for name, path in task.job.inputs.items()}
        return self.client.submit(
            performed,
            to_json(task.job),
            inputs,
            plugins,
            self.threads,
            self.project,
            modules=task.modules,
            pure=False,
        )

    def _end(self, task: Task, future: Any) -> None:
        """Hand on the outcome that the future of a task brings.

        Raises:
            InputError: the scheduler has gone away, or a worker cannot run the project, has another
                version of it, or has a full disk.
        """
        import distributed

        try:
            line, content = future.result()
            outcome = from_json(line, Outcome)
        except distributed.KilledWorker:
            outcome, content = Outcome("failed", WORKER_LOST), b""
        except InputError:  # a ValueError, too: the worker cannot do any cell, and says why
            raise
        except ValueError as error:
            outcome, content = Outcome("failed", f"its dask worker answered nonsense: {error}"), b""
        except (CancelledError, OSError):
            raise InputError(
                "the dask scheduler is gone; earlier results are intact: run the same command again"
            ) from None
        except ImportError as error:
            raise InputError(f"a dask worker cannot run the project: {error}") from None
        path = self.folder / "map.npz"
        if content:
            with disk_said(path), replacing(path) as stream:
                stream.write(content)
        task.ended(outcome, path)


_worker = threading.local()
"""The executor of each thread of a dask worker; all tasks that the thread gets share it."""


def performed(
    line: bytes,
    inputs: Mapping[str, bytes],
    plugins: Sequence[tuple[str, str, bytes]],
    threads: int,
    project: str,
    *,
    modules: tuple[str, ...],
) -> tuple[bytes, bytes]:
    """Do a job on a worker: its outcome as a line of JSON, and the content of its map file.

    Args:
        line: the job, as `to_json` writes it; its paths are those of the run's machine.
        inputs: the content of the files that the job reads, by the names of their fields.
        plugins: file name, class and source of each method that comes with it.
        threads: how many threads the job may use.
        project: version of the project that sends it.
        modules: packages that the supervisor imports before it forks.

    Raises:
        InputError: this worker has another version, or its disk is full.
    """
    host = socket.gethostname()
    if environment.project() != project:
        raise InputError(
            f"the dask worker on {host} has another version of the project, or of a package that "
            "it asks for; give it the same, and start it again"
        )
    job = from_json(line, RunJob, MeasureJob)
    if not hasattr(_worker, "local"):
        _worker.local = Local(Path(), threads, lambda: None)
    local: Local = _worker.local
    answers: list[tuple[bytes, bytes]] = []

    def ended(outcome: Outcome, path: Path) -> None:
        outcome = dataclasses.replace(outcome, host=f"{host} ({environment.processor()})")
        answers.append((to_json(outcome), path.read_bytes() if path.exists() else b""))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        local.folder = folder / "cells"
        places = {field: folder / f"{field}.npz" for field in inputs}
        for field, path in places.items():
            path.write_bytes(inputs[field])
        job = job.reading(places)
        locations = []
        for n, (file, kind, source) in enumerate(plugins):
            path = folder / str(n) / file
            path.parent.mkdir()
            path.write_bytes(source)
            locations.append(f"{path}:{kind}")
        if isinstance(job, RunJob):
            job = dataclasses.replace(job, plugins=tuple(locations))
        try:
            local.run([Task(job, lambda: None, ended, modules)], 1)
        except BaseException:
            del _worker.local
            local.__exit__()
            raise
    (answer,) = answers
    return answer


def dask_client(address: str, opened: contextlib.ExitStack) -> Client:
    """A client of the scheduler at `address`, once that has a worker.

    Raises:
        InputError: the scheduler does not answer, or has no worker.
    """
    import distributed

    connect: Any = distributed.Client
    try:
        client = connect(address, timeout=CONNECT_SECONDS)
    except TypeError:  # what distributed raises without certificates
        raise InputError(
            f"{address}: dask is told of no certificates; set distributed.comm.tls (docs/SCALE.md)"
        ) from None
    except (OSError, ValueError):
        raise InputError(
            f"no dask scheduler answers at {address}: start one with `dask scheduler`"
        ) from None
    opened.callback(client.close)
    try:
        client.wait_for_workers(1, timeout=CONNECT_SECONDS)
    except TimeoutError:
        raise InputError(
            f"the dask scheduler at {address} has no worker: start some with "
            f"`dask worker {address} --nthreads 1`"
        ) from None
    return _patient_once(client)


def slurm_client(jobs: int, memory: float, threads: int, opened: contextlib.ExitStack) -> Client:
    """A client of `jobs` workers, each a Slurm job, which may wait long in Slurm's queue.

    Partition, account and wall time come from dask-jobqueue's own configuration
    (`jobqueue.slurm.queue`, `.account`, `.walltime` in ~/.config/dask/jobqueue.yaml).
    """
    import distributed
    from dask_jobqueue.slurm import SLURMCluster

    connect: Any = distributed.Client
    start: Any = SLURMCluster
    cluster = opened.enter_context(
        start(
            cores=threads,
            processes=1,
            memory=f"{memory + WORKER_GIGABYTES} GB",
            worker_extra_args=["--nthreads", "1"],
        )
    )
    cluster.scale(jobs=jobs)
    return _patient_once(opened.enter_context(connect(cluster)))


def _patient_once(client: Client) -> Client:
    """The client, told that its scheduler repeats a task once if the task's worker dies."""

    def once(dask_scheduler: Any) -> None:  # a closure: the scheduler need not have the project
        dask_scheduler.allowed_failures = 1

    client.run_on_scheduler(once)
    return client
