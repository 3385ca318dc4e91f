"""A supervisor: runs one cell after another, each in a process of its own under two limits.

`python -m benchmarks.running.worker FD [MODULE ...]` imports whatever is slow to import, MODULE
included. It then takes jobs on standard input, runs each in a child process that it watches
(`benchmarks.running.cell`), and answers on file descriptor FD. `benchmarks.running.tasks` defines
the lines that go both ways.

On Linux the child is a fork, which costs milliseconds. The supervisor itself only imports and never
computes: it has no thread that a fork could lose (except OpenBLAS's own, which stop and restart
around a fork). It imports nothing on behalf of a cell, and no plugin: the tenth cell finds what the
first one found. All that it learns from its jobs is what the source files of methods import.
Elsewhere, where forking after such imports is unsafe, the child is a fresh interpreter.

A method can harm its own cell only. The child has its own session, its own empty working folder,
and a result pipe that ends with it. At a limit all its descendants are killed, including those that
have left its process group. If the supervisor's parent dies, so do they.

Memory is the resident memory of the whole process tree, looked at every `POLL` seconds: a limit on
address space would refuse what torch and CUDA only reserve. A method may therefore exceed its limit
for as long as one poll.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import gc
import importlib
import os
import select
import signal
import subprocess
import sys
import time
from pathlib import Path

import igl  # noqa: F401  imported before the forks, so that no cell pays for it
import scipy.sparse.linalg
import scipy.spatial  # noqa: F401  as above

from baselines import registry
from benchmarks.running import cell
from benchmarks.running.limits import (
    FORKS,
    adopt_orphans,
    bury,
    descendants,
    end_with,
    kill,
    resident,
    system_kills,
)
from benchmarks.running.tasks import (
    Job,
    MeasureJob,
    Outcome,
    Prepared,
    Ready,
    RunJob,
    from_json,
    to_json,
)
from parapoint import sources

POLL = 0.05
"""Seconds between two looks at the memory of the cell's process."""
TREE_POLL = 0.5
"""Seconds between two looks at its descendants, which take some milliseconds to find."""
LONGEST_SAID = 2 * cell.LONGEST_MESSAGE
"""Bytes that a cell may write into the pipe of its outcome, where a method may write as well."""


def main() -> None:
    """Supervise cells until standard input ends."""
    reply = int(sys.argv[1])
    os.set_inheritable(reply, False)
    if FORKS:
        adopt_orphans()
        for module in sys.argv[2:]:
            with contextlib.suppress(Exception):  # a method that needs it says so in its cell
                importlib.import_module(module)
    wake, waker = os.pipe()
    os.set_blocking(wake, False)
    os.set_blocking(waker, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)  # a handler is what makes the wake-up write
    signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
    registry.names()  # looks through the installed packages, so that no cell has to
    importlib.import_module("encodings.cp437")  # of names in zip archives, as above
    gc.freeze()  # a collection in a cell copies none of this
    jobs = os.fdopen(os.dup(0), "rb", buffering=0)
    os.write(reply, to_json(Ready()))
    while line := jobs.readline():
        job = from_json(line, RunJob, MeasureJob)
        if isinstance(job, RunJob):
            _parse(job.spec, job.plugins)
        if isinstance(job, MeasureJob):
            importlib.import_module("benchmarks.metrics.evaluation")  # once, before the forks
        outcome = _supervised(job, wake, [reply, wake, waker, jobs.fileno()])
        os.write(reply, to_json(dataclasses.replace(outcome, number=job.number)))


@functools.cache
def _parse(spec: str, plugins: tuple[str, ...]) -> None:
    """Parse a spec and the sources of its method, once for all its cells; import and run nothing.

    Each cell hashes the sources of its method (`parapoint.sources`), and needs to parse only those
    that have changed since.
    """
    modules = ["parapoint.surfaces.preparation"]
    with contextlib.suppress(Exception):  # a cell says what is wrong with its spec or sources
        name, _ = registry.parsed(spec)
        if name in registry.METHODS:
            modules.append(registry.METHODS[name].partition(":")[0])
        sources.sources(*modules)
        for plugin in plugins:
            path, _, _ = plugin.rpartition(":")
            sources.imported(Path(path).read_text(encoding="utf-8"), "")


def _supervised(job: Job, wake: int, private: list[int]) -> Outcome:
    """Run a job in a child to its end or to a limit, and leave nothing of it behind.

    Args:
        job: the job.
        wake: a descriptor that can be read once a child has ended.
        private: descriptors that the child must not have.
    """
    kills = system_kills()
    deadline = time.monotonic() + job.time_limit
    next_look = time.monotonic() + POLL
    next_tree = time.monotonic() + TREE_POLL
    result, send = os.pipe()
    child = _start(job, send, [*private, result])
    os.close(send)
    os.set_blocking(result, False)
    message = bytearray()
    verdict: Outcome | None = None
    peak = others = 0
    watched = [0, wake, result]
    while True:
        ready, _, _ = select.select(watched, [], [], POLL)
        if 0 in ready:  # jobs come one at a time, so this is the end of input: the run is gone
            bury(child)
            os._exit(1)
        if wake in ready:
            os.read(wake, 4096)
        if result in ready:
            chunk = os.read(result, 1 << 16)
            message += chunk
            if not chunk:
                watched.remove(result)
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            break
        now = time.monotonic()
        if now >= next_tree:
            others = sum(resident(process.pid) for process in descendants() if process.pid != child)
            next_tree = now + TREE_POLL
        if now >= next_look:
            memory = resident(child) + others
            peak = max(peak, memory)
            verdict = verdict or _beyond(job, memory, now > deadline)
            next_look = now + POLL
        if len(message) > LONGEST_SAID:
            message.clear()
            verdict = verdict or Outcome("failed", "wrote into the pipe of its outcome")
        if verdict is not None:
            kill(child)
    message += _available(result, LONGEST_SAID)
    os.close(result)
    bury(child)
    preprocessing, outcome = _said(message)
    if verdict is not None:
        outcome = dataclasses.replace(verdict, preprocessing=preprocessing)
    elif outcome is None:
        outcome = _death(status, killed_by_system=system_kills() > kills)
        outcome = dataclasses.replace(outcome, preprocessing=preprocessing)
    unit = 1 if sys.platform == "darwin" else 1024  # of ru_maxrss, in bytes
    return dataclasses.replace(outcome, peak_memory_mb=max(peak, usage.ru_maxrss * unit) / 1e6)


def _beyond(job: Job, memory: int, late: bool) -> Outcome | None:
    """The outcome of a job that is beyond one of its limits; None if it is within both.

    Args:
        job: the job.
        memory: what its processes hold, in bytes.
        late: whether its time is over.
    """
    if memory > job.memory_limit:
        limit = job.memory_limit / 1e6
        reason = f"used {memory / 1e6:.0f} MB of memory; the limit is {limit:.0f} MB"
        return Outcome("out_of_memory", reason)
    if late:
        return Outcome("timeout", f"not done within the limit of {job.time_limit:g} s")
    return None


def _start(job: Job, send: int, private: list[int]) -> int:
    """Start the child of a job, which answers on the descriptor `send`; its process id."""
    if not FORKS:
        process = subprocess.Popen(  # noqa: S603  our own module
            [sys.executable, "-c", f"from benchmarks.running import cell; cell.main({send})"],
            stdin=subprocess.PIPE,
            start_new_session=True,
            pass_fds=[send],
        )
        assert process.stdin is not None
        process.stdin.write(to_json(job))
        process.stdin.close()
        return process.pid
    supervisor = os.getpid()
    child = os.fork()
    if child:
        return child
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        os.setsid()
        end_with(supervisor)
        for descriptor in private:
            os.close(descriptor)
        cell.perform(job, send)
    finally:
        os._exit(1)


def _said(content: bytes | bytearray) -> tuple[str, Outcome | None]:
    """What a child sent, in whole lines: what was done to its surface, and how it ended.

    Any other line is ignored: the method may have written it into the pipe.
    """
    preprocessing, outcome = "", None
    for line in bytes(content).split(b"\n")[:-1]:
        with contextlib.suppress(ValueError):
            match from_json(line, Prepared, Outcome):
                case Prepared() as prepared:
                    preprocessing = prepared.preprocessing
                case Outcome() as ended:
                    outcome = ended
    return preprocessing, outcome


def _death(status: int, *, killed_by_system: bool) -> Outcome:
    """The outcome of a child that ended, with that wait status, without sending one."""
    if os.WIFSIGNALED(status):
        number = os.WTERMSIG(status)
        if number == signal.SIGKILL and killed_by_system:
            return Outcome("out_of_memory", "killed by the system, which ran out of memory")
        name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
        meaning = signal.strsignal(number) or ""
        return Outcome("failed", f"killed by {name} ({meaning.lower()})")
    code = os.WEXITSTATUS(status)
    return Outcome("failed", f"ended the process (exit status {code}) with no result")


def _available(pipe: int, most: int) -> bytes:
    """What can be read from `pipe` without waiting, that many bytes and a chunk at most."""
    content = bytearray()
    with contextlib.suppress(BlockingIOError):
        while len(content) <= most and (chunk := os.read(pipe, 1 << 16)):
            content += chunk
    return bytes(content)


if __name__ == "__main__":
    main()
