"""Runs the cells of a suite that a results folder does not have yet, each in its own process.

This process plans, hands cells to supervisors (`benchmarks.worker`), and alone writes rows. All of
it may be killed at any time: what has a row is kept, and the same call goes on from there.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import psutil

from baselines import registry
from benchmarks import environment, models
from benchmarks.results import ResultRow, Store, disk_said, identity, plain
from benchmarks.suites import Suite
from parapoint.errors import InputError
from parapoint.surface import Surface

TIME_LIMIT = 1800.0
"""Seconds a cell may take unless said otherwise."""
GRACE = 15.0
"""Seconds past its limit after which a supervisor itself counts as hung."""
OUTPUT_KEPT = 1 << 16
"""Bytes of a method's output that are held; what came before is dropped."""
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "IGL_NUM_THREADS",
)


@dataclass(frozen=True)
class Cell:
    """One case, method and seed to run.

    Attributes:
        row: its row before it has run: the identity is filled in, what comes after it is not.
        spec: the method as it was asked for, such as "slim(iterations=1)".
        why: why it runs: "new", or what changed since its last row.
    """

    row: ResultRow
    spec: str
    why: str


@dataclass(frozen=True)
class Chosen:
    """A method of a run: what was asked for, and what that is."""

    spec: str
    name: str
    params: Mapping[str, object]
    source_hash: str


@dataclass
class Summary:
    """What a run did.

    Attributes:
        suite: the suite, with the cases, methods and seeds that were asked for.
        ran: rows of the cells that ran, in the order in which they ended.
        reasons: how many cells ran for which reason.
        kept: rows of the cells that needed no run.
        missing: the cases whose model could not be had, and how to get each.
        seconds: wall time of the run.
        method_seconds: wall time spent in methods, all cells together, / jobs.
    """

    suite: Suite
    ran: list[ResultRow] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)
    kept: list[ResultRow] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    method_seconds: float = 0.0

    @property
    def rows(self) -> list[ResultRow]:
        """Rows of all cells of the run, kept or new."""
        return [*self.kept, *self.ran]


class Progress:
    """Hears how a run goes; this one says nothing."""

    def planned(self, summary: Summary, count: int) -> None:
        """`count` cells are going to run."""

    def started(self, cell: Cell) -> None:
        """A cell begins."""

    def ended(self, cell: Cell, row: ResultRow) -> None:
        """A cell has its row."""

    def tick(self) -> None:
        """Called some times a second."""


def run(
    suite: Suite,
    folder: Path | str,
    *,
    methods: Sequence[str] | None = None,
    cases: Sequence[str] | None = None,
    seeds: Sequence[int] | None = None,
    plugins: Sequence[str] = (),
    jobs: int = 1,
    timeout: float = TIME_LIMIT,
    memory: float | None = None,
    progress: Progress | None = None,
) -> Summary:
    """Run the cells of `suite` that `folder` lacks, and bring its metrics up to date.

    Args:
        suite: cases, methods and seeds; `methods`, `cases` and `seeds` replace its own.
        folder: the results folder.
        methods: specs, such as "slim" or "slim(iterations=1)".
        cases: names of models or paths of files.
        seeds: seeds, each a run of every method.
        plugins: "FILE.py:Class" of methods to add; without `methods` they join the suite's.
        jobs: cells at a time. More than one is faster and makes timings less honest.
        timeout: seconds a cell may take.
        memory: GB a cell's processes may hold; None: four fifths of the machine's, / jobs.
        progress: hears how it goes.

    Raises:
        InputError: a name is unknown, a file cannot be read, the folder is in use or from a newer
            version, the disk is full. In the first two cases nothing is written.
    """
    began = time.monotonic()
    progress = progress or Progress()
    suite, chosen = _choice(suite, methods, cases, seeds, plugins)
    store = Store(folder)
    loaded = _loaded(cases or ())
    limits = {
        "time_limit": timeout,
        "memory_limit": memory * 1e9 if memory else 0.8 * environment.memory() / jobs,
    }
    threads = environment.threads(jobs)
    summary = Summary(suite)
    with store.writing():
        surfaces = _surfaces(store, suite.cases, loaded, summary)
        here = environment.environment() | limits | {"jobs": jobs, "threads": threads}
        todo = list(_todo(suite, chosen, surfaces, store=store, here=here, summary=summary))
        progress.planned(summary, len(todo))
        if todo:
            number = store.add_run(here | {"suite": suite.name})
            book = _Book(store, number, summary, progress)
            present = [cell for cell in todo if cell.row.surface_hash]
            for cell in todo:
                if not cell.row.surface_hash:
                    reason = summary.missing[cell.row.case]
                    book.write(cell, {"status": "skipped", "reason": reason})
            job = limits | {"plugins": [_absolute(plugin) for plugin in plugins]}
            _Pool(book, job, threads).run(present, jobs)
        store.metrics()
    summary.seconds = time.monotonic() - began
    summary.method_seconds /= jobs
    return summary


def _absolute(plugin: str) -> str:
    """`plugin`, "FILE.py:Class", with the file's absolute path: cells run in other folders."""
    path, colon, name = plugin.rpartition(":")
    return f"{Path(path).resolve()}{colon}{name}"


def _choice(
    suite: Suite,
    methods: Sequence[str] | None,
    cases: Sequence[str] | None,
    seeds: Sequence[int] | None,
    plugins: Sequence[str],
) -> tuple[Suite, list[Chosen]]:
    """The suite as asked for, every name in it known, and its methods."""
    added = [registry.register_plugin(plugin) for plugin in plugins]
    specs = tuple(methods) if methods is not None else (*suite.methods, *added)
    chosen = []
    for spec in dict.fromkeys(specs):
        name, method = registry.method(spec)
        params = plain(dataclasses.asdict(cast("Any", method)))
        chosen.append(Chosen(spec, name, params, registry.source_hash(method)))
    asked = suite.cases if cases is None else cases
    names = tuple(dict.fromkeys(models.canonical_name(case) for case in asked))
    asked_seeds = suite.seeds if seeds is None else tuple(dict.fromkeys(seeds))
    return dataclasses.replace(suite, cases=names, methods=specs, seeds=asked_seeds), chosen


def _loaded(cases: Sequence[str]) -> dict[str, Surface | InputError]:
    """The surfaces that were asked for by name, read before anything is written.

    Raises:
        InputError: a file cannot be read, or every model is missing.
    """
    loaded: dict[str, Surface | InputError] = {}
    for case in cases:
        try:
            loaded[models.canonical_name(case)] = models.load(case)
        except models.MissingModelError as error:
            loaded[models.canonical_name(case)] = error
    missing = [error for error in loaded.values() if isinstance(error, InputError)]
    if missing and len(missing) == len(loaded):
        raise missing[0]
    return loaded


def _surfaces(
    store: Store,
    cases: Sequence[str],
    loaded: Mapping[str, Surface | InputError],
    summary: Summary,
) -> dict[str, str]:
    """The hash of each case's surface, stored; "" where the model is missing."""
    hashes = {}
    for case in cases:
        surface = loaded.get(case)
        if surface is None:
            try:
                surface = models.load(case)
            except InputError as error:
                surface = error
        if isinstance(surface, InputError):
            summary.missing[case] = " ".join(str(surface).split())
            hashes[case] = ""
        else:
            hashes[case] = store.add_surface(surface)
    return hashes


def _todo(
    suite: Suite,
    chosen: Sequence[Chosen],
    surfaces: Mapping[str, str],
    *,
    store: Store,
    here: Mapping[str, Any],
    summary: Summary,
) -> Iterator[Cell]:
    """The cells that must run; rows of the others go to `summary.kept`."""
    rows = {row.cell: row for row in store.rows()}
    runs = store.environment()["runs"]
    seen = set()
    for case in suite.cases:
        for method in chosen:
            for seed in suite.seeds:
                blank = _blank(suite.name, case, method, seed=seed, surface_hash=surfaces[case])
                if blank.id in seen:
                    continue
                seen.add(blank.id)
                row = rows.get(blank.cell)
                why = "new" if row is None else _changed(blank, row, store, runs, here)
                if why:
                    summary.reasons[why] += 1
                    yield Cell(blank, method.spec, why)
                elif row is not None:
                    summary.kept.append(row)


def _blank(suite: str, case: str, method: Chosen, *, seed: int, surface_hash: str) -> ResultRow:
    """The row of a cell that has not run."""
    row_id = identity(
        suite=suite,
        case=case,
        method=method.name,
        params=method.params,
        seed=seed,
        source_hash=method.source_hash,
        surface_hash=surface_hash,
    )
    return ResultRow(
        id=row_id,
        suite=suite,
        case=case,
        method=method.name,
        params=method.params,
        seed=seed,
        source_hash=method.source_hash,
        surface_hash=surface_hash,
        status="skipped",
    )


def _changed(
    cell: ResultRow,
    row: ResultRow,
    store: Store,
    runs: Sequence[Mapping[str, Any]],
    here: Mapping[str, Any],
) -> str:
    """Why a cell that has a row must run again; "" if it need not."""
    if row.source_hash != cell.source_hash:
        return "method changed"
    if row.surface_hash != cell.surface_hash:
        return "model changed" if row.surface_hash else "model was missing"
    if row.status == "ok":
        return "" if store.uv_path(row.id).exists() else "map missing"
    if row.status == "skipped" and not row.surface_hash:
        return ""
    there = runs[row.run] if 0 <= row.run < len(runs) else {}
    if any(there.get(name) != here[name] for name in environment.MACHINE):
        return f"{row.status} in another environment"
    limit = {"timeout": "time_limit", "out_of_memory": "memory_limit"}.get(row.status)
    if limit and here[limit] > there.get(limit, 0) * 1.01:  # the machine's own total may vary
        return "limit raised"
    return ""


class _Slot:
    """A supervisor process, and the cell that it is busy with."""

    def __init__(self, threads: int) -> None:
        """Start a supervisor whose cells may use `threads` threads."""
        self.replies, send = os.pipe()
        variables = dict.fromkeys(THREAD_VARIABLES, str(threads)) | {"PYTHONHASHSEED": "0"}
        self.process = subprocess.Popen(  # noqa: S603  our own module
            [sys.executable, "-m", "benchmarks.worker", str(send)],
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
        self.cell: Cell | None = None
        self.folder = Path()
        self.started = time.monotonic()

    def hear(self) -> list[dict[str, Any]] | None:
        """Outcomes that have come in; None once the supervisor is gone."""
        content = _available(self.replies)
        if content is None and not self.reply:
            return None
        self.reply += content or b""
        *lines, rest = self.reply.split(b"\n")
        self.reply = bytearray(rest if content is not None else b"")
        return [json.loads(line) for line in lines]

    def drain(self) -> None:
        """Take in what was printed, so that no method waits for a reader; keep the end of it."""
        content = _available(self.output)
        if content:
            self.printed += content
            del self.printed[:-OUTPUT_KEPT]

    def close(self) -> None:
        """End the supervisor and with it all that runs below it."""
        with contextlib.suppress(OSError):
            self.jobs.close()
        try:
            self.process.wait(GRACE / 3)
        except subprocess.TimeoutExpired:
            with contextlib.suppress(psutil.Error):
                below = psutil.Process(self.process.pid).children(recursive=True)
                for process in below:
                    with contextlib.suppress(psutil.Error):
                        process.kill()
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        os.close(self.replies)


def _available(pipe: int) -> bytes | None:
    """What can be read from `pipe` at once, one megabyte at most; None at its end."""
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


class _Book:
    """Where the rows of one run go."""

    def __init__(self, store: Store, number: int, summary: Summary, progress: Progress) -> None:
        """`number` is the run's entry in the environment."""
        self.store = store
        self.number = number
        self.summary = summary
        self.progress = progress

    def write(self, cell: Cell, outcome: Mapping[str, Any]) -> None:
        """Write the row of `cell`."""
        row = dataclasses.replace(cell.row, run=self.number, **outcome)
        self.store.append(row)
        self.summary.ran.append(row)
        self.progress.ended(cell, row)


class _Pool:
    """Slots that work off cells."""

    def __init__(self, book: _Book, job: Mapping[str, Any], threads: int) -> None:
        """`job` holds what all cells share: limits and plugins."""
        self.book = book
        self.job = job
        self.threads = threads
        self.cells = book.store.folder / "cells"
        self.selector = selectors.DefaultSelector()
        self.slots: set[_Slot] = set()
        self.waiting: Iterator[Cell] = iter(())

    def run(self, cells: Sequence[Cell], jobs: int) -> None:
        """Run all cells; on the way out, however that comes, no process is left."""
        shutil.rmtree(self.cells, ignore_errors=True)  # of a run that was killed
        self.waiting = iter(cells)
        try:
            for _ in range(min(jobs, len(cells))):
                self._open()
            while self.slots:
                self._step()
                self.book.progress.tick()
        finally:
            for slot in self.slots:
                slot.close()
            self.selector.close()
            shutil.rmtree(self.cells, ignore_errors=True)

    def _open(self) -> None:
        slot = _Slot(self.threads)
        self.slots.add(slot)
        self.selector.register(slot.replies, selectors.EVENT_READ, slot)
        self.selector.register(slot.output, selectors.EVENT_READ, slot)

    def _close(self, slot: _Slot) -> None:
        self.slots.discard(slot)
        self.selector.unregister(slot.replies)
        self.selector.unregister(slot.output)
        slot.close()

    def _step(self) -> None:
        """Wait a moment for news, and deal with it."""
        for slot in {key.data for key, _ in self.selector.select(0.1)}:
            slot.drain()
            news = slot.hear()
            for outcome in news or ():
                if slot.cell is not None:
                    self._finish(slot, outcome)
                self._next(slot)
            if news is None:
                self._lost(slot)
        late = time.monotonic() - self.job["time_limit"] - GRACE
        for slot in [slot for slot in self.slots if slot.cell is not None and slot.started < late]:
            self._lost(slot)

    def _next(self, slot: _Slot) -> None:
        """Give the slot the next cell, or end it."""
        cell = next(self.waiting, None)
        if cell is None:
            self._close(slot)
            return
        with disk_said(self.cells):
            self.cells.mkdir(exist_ok=True)
            slot.folder = Path(tempfile.mkdtemp(dir=self.cells)).resolve()
            (slot.folder / "work").mkdir()
        slot.printed.clear()
        slot.cell = cell
        slot.started = time.monotonic()
        self.book.progress.started(cell)
        job = {
            **self.job,
            "spec": cell.spec,
            "seed": cell.row.seed,
            "source_hash": cell.row.source_hash,
            "surface": str(self.book.store.surface_path(cell.row.surface_hash).resolve()),
            "map": str(slot.folder / "map.npz"),
            "work": str(slot.folder / "work"),
        }
        with contextlib.suppress(OSError):  # a supervisor that is gone is heard of next
            slot.jobs.write(json.dumps(job).encode() + b"\n")

    def _lost(self, slot: _Slot) -> None:
        """Deal with a supervisor that is gone or hangs: its cell ends here, another takes over."""
        if slot.cell is None:
            said = last_lines(slot.printed, lines=1)
            raise RuntimeError(f"benchmarks.worker ended unasked: {said}")
        limit = self.job["time_limit"]
        if slot.process.poll() is None and time.monotonic() > slot.started + limit:
            reason = f"not done within the limit of {limit:g} s, and hard to kill"
            self._finish(slot, {"status": "timeout", "reason": reason})
        else:
            reason = "killed the process that watched over it"
            self._finish(slot, {"status": "failed", "reason": reason})
        self._close(slot)
        self._open()

    def _finish(self, slot: _Slot, outcome: dict[str, Any]) -> None:
        """Write the row of the slot's cell, its map before."""
        cell = slot.cell
        assert cell is not None
        slot.cell = None
        if outcome["status"] == "stop":
            raise InputError(
                f"{outcome['reason']}; earlier results are intact: mend that and run again"
            )
        took = time.monotonic() - slot.started
        self.book.summary.method_seconds += outcome.get("seconds") or took
        if outcome["status"] == "ok":
            self.book.store.add_map(cell.row.id, slot.folder / "map.npz")
            outcome["uv_file"] = f"uv/{cell.row.id}.npz"
        else:
            outcome["output"] = last_lines(slot.printed)
        self.book.write(cell, outcome)
        shutil.rmtree(slot.folder, ignore_errors=True)


def last_lines(printed: bytes | bytearray, lines: int = 20, characters: int = 4000) -> str:
    """The end of what a method printed."""
    text = printed.decode(errors="replace")[-characters:]
    return "\n".join(text.splitlines()[-lines:])
