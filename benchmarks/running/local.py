"""Runs cells on this machine, below supervisors (`benchmarks.running.worker`) that it starts."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Self

import psutil

from benchmarks.running import environment, scratch
from benchmarks.running.limits import adopt_orphans, end_orphans
from benchmarks.running.tasks import Message, Outcome, Ready, Task, Tick, from_json, to_json
from benchmarks.store.archives import disk_said
from benchmarks.store.rows import WATCHER_KILLED
from parapoint.errors import InputError

GRACE = 15.0
"""Seconds past a cell's time limit after which its supervisor counts as hung."""
LONGEST_LINE = 1 << 22
"""Bytes of a supervisor's answer, at most."""
MOST_STARTS = 3
"""How often a supervisor that ends before it is ready is started again."""
OUTPUT_KEPT = 1 << 16
"""Bytes of a method's output that are kept in memory: the last ones."""
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "IGL_NUM_THREADS",
)
"""Environment variables by which libraries are told how many threads they may start."""


class _Slot:
    """A supervisor process, and the task that it does, or will do once it is ready."""

    def __init__(self, threads: int, interpreter: str, modules: tuple[str, ...]) -> None:
        """Start a supervisor.

        Args:
            threads: how many threads its cells may use.
            interpreter: the Python that runs it, and them.
            modules: what it imports.
        """
        self.interpreter = interpreter
        self.modules = modules
        self.replies, send = os.pipe()
        variables = dict.fromkeys(THREAD_VARIABLES, str(threads))
        # What a cell printed is kept, too, where it is killed before it ends.
        variables |= {"PYTHONHASHSEED": "0", "PYTHONUNBUFFERED": "1"}
        self.process = subprocess.Popen(  # noqa: S603  our own module
            [interpreter, "-m", "benchmarks.running.worker", str(send), *modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=[send],
            start_new_session=True,
            cwd=environment.ROOT,
            env={"OMP_WAIT_POLICY": "passive"} | os.environ | variables,  # see `parapoint.cli`
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
        self.folder: Path | None = None  # never the working directory: `_end` removes it
        self.number = 0
        self.started = math.inf

    @property
    def time_limit(self) -> float:
        """Seconds that the task may take; infinite without a task."""
        return self.task.job.time_limit if self.task else math.inf

    def begin(self, task: Task, folder: Path) -> None:
        """Send the supervisor its task, which may write into `folder`."""
        self.printed.clear()
        self.folder = folder
        self.started = time.monotonic()
        inputs = {name: path.resolve() for name, path in task.job.inputs.items()}
        job = dataclasses.replace(task.job.reading(inputs), folder=folder, number=self.number)
        with contextlib.suppress(OSError):  # `hear` notices a supervisor that is gone
            self.jobs.write(to_json(job))

    def hear(self) -> list[Message] | None:
        """The messages that have come in; None once the supervisor is gone.

        Raises:
            ValueError: a line is no message, or too long for one.
        """
        content = _available(self.replies)
        if content is None:
            return None
        *lines, self.reply = (self.reply + content).split(b"\n")
        if len(self.reply) > LONGEST_LINE:
            raise ValueError("a line is too long")
        return [from_json(bytes(line), Ready, Outcome) for line in lines]

    def drain(self) -> None:
        """Read what the method has printed, so that it never waits for a reader; keep the end."""
        self.printed += _available(self.output) or b""
        del self.printed[:-OUTPUT_KEPT]

    def close(self) -> None:
        """End the supervisor, and every process below it."""
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
    """What can be read from `pipe` without waiting, about a megabyte at most; None at its end."""
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
    """The executor (`tasks.Executor`) of this machine."""

    def __init__(self, folder: Path, threads: int, tick: Tick) -> None:
        """An executor without supervisors yet.

        Args:
            folder: scratch folder of the run; each task writes into a folder below it.
            threads: how many threads a cell may use.
            tick: called several times a second.
        """
        self.folder = folder
        self.threads = threads
        self.width = environment.cores()
        self.tick = tick
        self.selector = selectors.DefaultSelector()
        self.slots: set[_Slot] = set()
        self.harmful: set[tuple[str, ...]] = set()
        """Modules whose import ended a supervisor; tasks that need them import them themselves."""
        self.sent = 0
        self.starts = 0
        self.others = {child.pid for child in psutil.Process().children()}
        """Children that this process had before: no orphans of cells."""
        adopt_orphans()

    def __enter__(self) -> Self:
        """Clear what a run that was killed may have left."""
        scratch.clear(self.folder)
        return self

    def __exit__(self, *_: object) -> None:
        """End all supervisors, and every process below them."""
        for slot in self.slots:
            slot.close()
        end_orphans(self.others)
        adopt_orphans(is_parent=False)
        self.selector.close()
        scratch.remove(self.folder)

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time."""
        waiting = deque(tasks)
        while waiting or self._busy():
            while waiting and self._busy() < jobs:
                self._assign(waiting.popleft())
            self._listen()
            self.tick()

    def _busy(self) -> int:
        """How many supervisors have a task."""
        return sum(slot.task is not None for slot in self.slots)

    def _assign(self, task: Task) -> None:
        """Give a task to an idle supervisor like the one it needs, or to a new one."""
        modules = () if task.modules in self.harmful else task.modules
        for slot in self.slots:
            same = (slot.interpreter, slot.modules) == (task.interpreter, modules)
            if slot.task is None and same:
                slot.task = task
                self._begin(slot, task)
                return
        slot = _Slot(self.threads, task.interpreter, modules)
        slot.task = task
        self.slots.add(slot)
        self.selector.register(slot.replies, selectors.EVENT_READ, slot)
        self.selector.register(slot.output, selectors.EVENT_READ, slot)

    def _begin(self, slot: _Slot, task: Task) -> None:
        """Let a supervisor that is ready begin its task, in a new folder."""
        with disk_said(self.folder):
            scratch.renew(self.folder)
            folder = Path(tempfile.mkdtemp(dir=self.folder)).resolve()
            (folder / "work").mkdir()
        self.sent += 1
        slot.number = self.sent
        slot.begin(task, folder)
        task.began()

    def _listen(self) -> None:
        """Wait a moment for messages, and deal with them; notice supervisors that hang."""
        for slot in {key.data for key, _ in self.selector.select(0.1)}:
            try:
                news = slot.hear()
            except ValueError as error:
                self._lost(slot, f"the process that watched over it answered nonsense: {error}")
                continue
            slot.drain()
            for message in news or ():
                self._take_in(slot, message)
            if news is None:
                self._lost(slot, WATCHER_KILLED)
        now = time.monotonic()
        for slot in [slot for slot in self.slots if now > slot.started + slot.time_limit + GRACE]:
            self._lost(slot, "")

    def _take_in(self, slot: _Slot, message: Message) -> None:
        """Deal with a message; one that is not about the supervisor's task is no answer to it."""
        if slot.task is None:
            return
        if isinstance(message, Outcome) and slot.ready:
            if message.number == slot.number:
                self._end(slot, message)
        elif isinstance(message, Ready) and not slot.ready:
            slot.ready = True
            self.starts = 0
            self._begin(slot, slot.task)

    def _lost(self, slot: _Slot, reason: str) -> None:
        """Give up a supervisor that has ended or hangs.

        Args:
            slot: the supervisor.
            reason: why the task that it had begun fails, unless its time is over.

        Raises:
            InputError: no supervisor comes to be ready, time after time, in this environment.
        """
        self.slots.discard(slot)
        self.selector.unregister(slot.replies)
        self.selector.unregister(slot.output)
        slot.close()
        end_orphans(self.others | {other.process.pid for other in self.slots})
        if slot.task is None:  # killed from outside, between two tasks
            return
        if not slot.ready:
            self.starts += 1
            if slot.modules:
                self.harmful.add(slot.modules)
            elif self.starts >= MOST_STARTS:
                said = f"no process can be started for a cell: {last_lines(slot.printed, lines=1)}"
                if slot.interpreter == sys.executable:
                    raise InputError(said)
                self.starts = 0
                slot.task.ended(
                    Outcome("failed", f"in its environment {said}"), self.folder / "none"
                )
                return
            self._assign(slot.task)
        elif time.monotonic() > slot.started + slot.time_limit:
            late = f"not done within the limit of {slot.time_limit:g} s, and hard to kill"
            self._end(slot, Outcome("timeout", late))
        else:
            self._end(slot, Outcome("failed", reason))

    def _end(self, slot: _Slot, outcome: Outcome) -> None:
        """Hand on the outcome of the task that a supervisor has done."""
        task, folder = slot.task, slot.folder
        assert task is not None
        assert folder is not None
        slot.task = None
        took, printed = time.monotonic() - slot.started, last_lines(slot.printed)
        outcome = dataclasses.replace(outcome, took=took, printed=printed)
        task.ended(outcome, folder / "map.npz")
        shutil.rmtree(folder, ignore_errors=True)


def last_lines(printed: bytes | bytearray, lines: int = 20, characters: int = 4000) -> str:
    """The last lines of what a method printed, that many characters at most."""
    text = printed.decode(errors="replace")[-characters:]
    return "\n".join(text.splitlines()[-lines:])
