"""Where the cells of a run are worked off: on this machine, or on the workers of a cluster.

`local` has supervisors (`benchmarks.worker`) as child processes. `dask://HOST:PORT` has the same
supervisors below each worker of a dask scheduler, and `slurm` starts such workers as jobs of a
Slurm cluster. Whatever the executor, a cell has a process of its own under its own limits, its
outcome and map come back to the process that began the run, and that process alone writes.

No file system is shared with a worker: a task carries the content of the files that it reads, and
its answer that of the map. A worker must have the same version of the project and of the packages
it asks for; one that has not ends the run with a line that says so.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import json
import math
import os
import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

import psutil

from benchmarks import environment
from benchmarks.archives import disk_said, replacing
from parapoint.errors import InputError

GRACE = 15.0
"""Seconds past its limit after which a supervisor itself counts as hung."""
OUTPUT_KEPT = 1 << 16
"""Bytes of a method's output that are held; what came before is dropped."""
CONNECT_SECONDS = 30
"""How long a scheduler may take to answer, and its first worker to be there."""
WORKER_LOST = "two workers died while they ran it; run again"
"""Reason of a row that the next run does anew: machines go away through no fault of a method."""
WORKER_GIGABYTES = 2
"""Memory of a Slurm job beside that of its cell: for the worker and the supervisor."""
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "IGL_NUM_THREADS",
)

Outcome = dict[str, Any]
Tick = Callable[[], None]
Client = Any
"""A `distributed.Client`; the package is optional, and half of it has no types."""


class Executor(Protocol):
    """Works off tasks. A context manager: after it, no process of this machine is left.

    Attributes:
        threads: how many threads a cell may use.
        width: how many tasks it may do at a time where nothing is timed.
    """

    threads: int
    width: int

    def __enter__(self) -> Self:
        """Get ready."""
        ...

    def __exit__(self, *_: object) -> None:
        """End all processes and connections."""
        ...

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time."""
        ...


def executor(name: str, folder: Path, *, jobs: int, memory: float | None, tick: Tick) -> Executor:
    """The executor of a name: local, dask://HOST:PORT or slurm.

    Args:
        name: its name.
        folder: where tasks may write on this machine; it goes with the executor.
        jobs: cells at a time.
        memory: GB that a cell may hold; workers elsewhere have it from nowhere else.
        tick: called some times a second.

    Raises:
        InputError: there is no such executor, a package that it needs is missing, or `memory` is.
    """
    if name == "local":
        return Local(folder, environment.threads(jobs), tick)
    scheme, _, address = name.partition("://")
    if name != "slurm" and not (scheme == "dask" and address):
        raise InputError(f"there is no executor {name!r}; there are local, dask://HOST:PORT, slurm")
    for package in ("distributed", *["dask_jobqueue"] * (name == "slurm")):
        if importlib.util.find_spec(package) is None:
            raise InputError(
                f"the executor {name} needs the package {package}: "
                "python -m pip install -e '.[bench,cluster]'"
            )
    if memory is None:
        raise InputError(f"say how many GB a cell may hold on a worker of {name}: --memory 8")
    threads = environment.threads(environment.cores())
    if name == "slurm":
        return Remote(functools.partial(slurm_client, jobs, memory, threads), folder, jobs, tick)
    return Remote(functools.partial(dask_client, f"tcp://{address}"), folder, jobs, tick)


@dataclass(frozen=True)
class Task:
    """Something for a supervisor to do.

    Attributes:
        job: what the supervisor is told, its limits included.
        inputs: the files that it reads, by the name under which it is told where each is.
        began: called when it is under way.
        ended: called with its outcome, the last lines printed and the file it may have written.
        modules: what its supervisor has imported before, so that the task need not. Another set of
            them, another supervisor: what a task finds in memory is not up to those before it.
    """

    job: Mapping[str, Any]
    inputs: Mapping[str, Path]
    began: Callable[[], None]
    ended: Callable[[Outcome, str, Path], None]
    modules: tuple[str, ...] = ()


class _Slot:
    """A supervisor process, and the task that it is busy with or gets once it is ready."""

    def __init__(self, threads: int, modules: tuple[str, ...]) -> None:
        """Start a supervisor with `modules`, whose children may use `threads` threads."""
        self.modules = modules
        self.replies, send = os.pipe()
        variables = dict.fromkeys(THREAD_VARIABLES, str(threads)) | {"PYTHONHASHSEED": "0"}
        self.process = subprocess.Popen(  # noqa: S603  our own module
            [sys.executable, "-m", "benchmarks.worker", str(send), *modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=[send],
            start_new_session=True,
            cwd=environment.ROOT,
            env=os.environ | variables,
            bufsize=0,
        )
        os.close(send)
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.jobs = self.process.stdin
        self.output = self.process.stdout.fileno()
        os.set_blocking(self.output, False)
        os.set_blocking(self.replies, False)
        self.reply = bytearray()
        self.printed = bytearray()
        self.ready = False
        self.task: Task | None = None
        self.folder = Path()
        self.started = math.inf

    @property
    def time_limit(self) -> float:
        """Seconds that the task may take."""
        return float(self.task.job["time_limit"]) if self.task else math.inf

    def begin(self, task: Task, folder: Path) -> None:
        """Begin its task, which may write into `folder`."""
        self.printed.clear()
        self.folder = folder
        self.started = time.monotonic()
        inputs = {name: str(path.resolve()) for name, path in task.inputs.items()}
        places = {"map": str(folder / "map.npz"), "work": str(folder / "work")}
        job = {**task.job, **inputs, **places}
        with contextlib.suppress(OSError):  # a supervisor that is gone is heard of next
            self.jobs.write(json.dumps(job).encode() + b"\n")

    def hear(self) -> list[Outcome] | None:
        """Outcomes that have come in; None once the supervisor is gone."""
        content = _available(self.replies)
        if content is None:
            return None
        *lines, self.reply = (self.reply + content).split(b"\n")
        return [json.loads(line) for line in lines]

    def drain(self) -> None:
        """Take in what was printed, so that no method waits for a reader; keep the end of it."""
        self.printed += _available(self.output) or b""
        del self.printed[:-OUTPUT_KEPT]

    def close(self) -> None:
        """End the supervisor and with it all that runs below it."""
        with contextlib.suppress(OSError):
            self.jobs.close()
        try:
            self.process.wait(GRACE / 3)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(psutil.Error):
                for process in psutil.Process(self.process.pid).children(recursive=True):
                    with contextlib.suppress(psutil.Error):
                        process.kill()
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        os.close(self.replies)


def _available(pipe: int) -> bytes | None:
    """What can be read from `pipe` at once, one megabyte or so at most; None at its end."""
    content = bytearray()
    while len(content) < 1 << 20:
        try:
            chunk = os.read(pipe, 1 << 16)
        except BlockingIOError:
            break
        if not chunk:
            return bytes(content) or None
        content += chunk
    return bytes(content)


class Local:
    """Supervisors on this machine."""

    def __init__(self, folder: Path, threads: int, tick: Tick) -> None:
        """Tasks write into folders below `folder`, which goes with the executor."""
        self.folder = folder
        self.threads = threads
        self.width = environment.cores()
        self.tick = tick
        self.selector = selectors.DefaultSelector()
        self.slots: set[_Slot] = set()
        self.harmful: set[tuple[str, ...]] = set()
        """Modules whose import ended a supervisor: tasks import these themselves."""

    def __enter__(self) -> Self:
        """Clear what a run that was killed has left."""
        shutil.rmtree(self.folder, ignore_errors=True)
        return self

    def __exit__(self, *_: object) -> None:
        """End all supervisors and what runs below them."""
        for slot in self.slots:
            slot.close()
        self.selector.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time."""
        waiting = deque(tasks)
        while waiting or self._busy():
            while waiting and self._busy() < jobs:
                self._assign(waiting.popleft())
            self._listen()
            self.tick()

    def _busy(self) -> int:
        return sum(slot.task is not None for slot in self.slots)

    def _assign(self, task: Task) -> None:
        """Give `task` to an idle supervisor that has its modules, or to a new one."""
        modules = () if task.modules in self.harmful else task.modules
        for slot in self.slots:
            if slot.task is None and slot.modules == modules:
                slot.task = task
                self._begin(slot, task)
                return
        slot = _Slot(self.threads, modules)
        slot.task = task
        self.slots.add(slot)
        self.selector.register(slot.replies, selectors.EVENT_READ, slot)
        self.selector.register(slot.output, selectors.EVENT_READ, slot)

    def _begin(self, slot: _Slot, task: Task) -> None:
        with disk_said(self.folder):
            self.folder.mkdir(exist_ok=True)
            folder = Path(tempfile.mkdtemp(dir=self.folder)).resolve()
            (folder / "work").mkdir()
        slot.begin(task, folder)
        task.began()

    def _listen(self) -> None:
        """Wait a moment for news, and deal with it."""
        for slot in {key.data for key, _ in self.selector.select(0.1)}:
            news = slot.hear()
            slot.drain()
            for outcome in news or ():
                if slot.task is not None and slot.ready:
                    self._end(slot, outcome)
                elif slot.task is not None:
                    slot.ready = True
                    self._begin(slot, slot.task)
            if news is None:
                self._lost(slot)
        now = time.monotonic()
        for slot in [slot for slot in self.slots if now > slot.started + slot.time_limit + GRACE]:
            self._lost(slot)

    def _lost(self, slot: _Slot) -> None:
        """Deal with a supervisor that is gone or hangs: a task that it had begun ends with it."""
        self.slots.discard(slot)
        self.selector.unregister(slot.replies)
        self.selector.unregister(slot.output)
        slot.close()
        if not slot.ready and slot.modules and slot.task is not None:
            self.harmful.add(slot.modules)
            self._assign(slot.task)
        elif not slot.ready or slot.task is None:
            said = last_lines(slot.printed, lines=1)
            raise RuntimeError(f"benchmarks.worker ended unasked: {said}")
        elif time.monotonic() > slot.started + slot.time_limit:
            reason = f"not done within the limit of {slot.time_limit:g} s, and hard to kill"
            self._end(slot, {"status": "timeout", "reason": reason})
        else:
            reason = "killed the process that watched over it"
            self._end(slot, {"status": "failed", "reason": reason})

    def _end(self, slot: _Slot, outcome: Outcome) -> None:
        task = slot.task
        assert task is not None
        slot.task = None
        if outcome["status"] == "stop":
            raise InputError(
                f"{outcome['reason']}; earlier results are intact: mend that and run again"
            )
        outcome["took"] = time.monotonic() - slot.started
        task.ended(outcome, last_lines(slot.printed), slot.folder / "map.npz")
        shutil.rmtree(slot.folder, ignore_errors=True)


class Remote:
    """Supervisors below the workers of a dask scheduler."""

    def __init__(
        self,
        connected: Callable[[contextlib.ExitStack], Client],
        folder: Path,
        jobs: int,
        tick: Tick,
    ) -> None:
        """`connected` makes the client, and leaves what is to be closed after the run."""
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
        shutil.rmtree(self.folder, ignore_errors=True)
        self.client = self.connected(self.open)
        return self

    def __exit__(self, *_: object) -> None:
        """Disconnect; workers that the run has started end."""
        self.open.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time, so that no worker holds one that it does not run."""
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
        """The future of a task."""
        plugins = []
        for plugin in task.job.get("plugins", ()):
            path, _, name = plugin.rpartition(":")
            plugins.append((Path(path).name, name, Path(path).read_bytes()))
        inputs = {name: path.read_bytes() for name, path in task.inputs.items()}
        return self.client.submit(
            performed,
            task.job,
            inputs,
            plugins,
            self.threads,
            self.project,
            modules=task.modules,
            pure=False,
        )

    def _end(self, task: Task, future: Any) -> None:
        """Take in the answer to a task.

        Raises:
            InputError: the scheduler or a worker is of no use for this run.
        """
        import distributed

        try:
            outcome, printed, content = future.result()
        except distributed.KilledWorker:
            outcome = {"status": "failed", "reason": WORKER_LOST, "took": 0.0}
            printed, content = "", b""
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
        task.ended(outcome, printed, path)


_worker = threading.local()
"""Of each thread of a dask worker: its supervisor, which all tasks share that it is given."""


def performed(
    job: Mapping[str, Any],
    inputs: Mapping[str, bytes],
    plugins: Sequence[tuple[str, str, bytes]],
    threads: int,
    project: str,
    *,
    modules: tuple[str, ...],
) -> tuple[Outcome, str, bytes]:
    """Do a task on a worker: its outcome, the last lines printed, and the map file.

    Args:
        job: what the supervisor is told.
        inputs: the content of the files that the task reads.
        plugins: file name, class and source of each method that comes with it.
        threads: how many threads it may use.
        project: version of the project that sends it.
        modules: what its supervisor is to have imported.

    Raises:
        InputError: this worker has another version, or its disk is full.
    """
    host = socket.gethostname()
    if environment.project() != project:
        raise InputError(
            f"the dask worker on {host} has another version of the project, or of a package that "
            "it asks for; give it the same, and start it again"
        )
    if not hasattr(_worker, "local"):
        _worker.local = Local(Path(), threads, lambda: None)
    local: Local = _worker.local
    answers: list[tuple[Outcome, str, bytes]] = []

    def ended(outcome: Outcome, printed: str, path: Path) -> None:
        outcome["host"] = f"{host} ({environment.processor()})"
        answers.append((outcome, printed, path.read_bytes() if path.exists() else b""))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        local.folder = folder / "cells"
        places = {key: folder / f"{key}.npz" for key in inputs}
        for key, path in places.items():
            path.write_bytes(inputs[key])
        locations = []
        for n, (file, kind, source) in enumerate(plugins):
            path = folder / str(n) / file
            path.parent.mkdir()
            path.write_bytes(source)
            locations.append(f"{path}:{kind}")
        task = Task({**job, "plugins": locations}, places, lambda: None, ended, modules)
        try:
            local.run([task], 1)
        except BaseException:
            del _worker.local
            local.__exit__()
            raise
    (answer,) = answers
    return answer


def dask_client(address: str, opened: contextlib.ExitStack) -> Client:
    """A client of the scheduler at `address`, which has a worker.

    Raises:
        InputError: it does not answer, or has no worker.
    """
    import distributed

    connect: Any = distributed.Client
    try:
        client = connect(address, timeout=CONNECT_SECONDS)
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
    """A client of `jobs` workers, each a Slurm job; they may wait in the queue for long.

    Partition, account and wall time are those of dask-jobqueue's own configuration
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
    """`client`, whose scheduler runs a task whose worker died once again, and no more."""

    def once(dask_scheduler: Any) -> None:  # a closure: the scheduler need not have the project
        dask_scheduler.allowed_failures = 1

    client.run_on_scheduler(once)
    return client


def last_lines(printed: bytes | bytearray, lines: int = 20, characters: int = 4000) -> str:
    """The end of what a method printed."""
    text = printed.decode(errors="replace")[-characters:]
    return "\n".join(text.splitlines()[-lines:])
