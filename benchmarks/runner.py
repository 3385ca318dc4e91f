"""Runs the cells of a suite that a results folder does not have yet, each in its own process.

This process plans, hands cells to supervisors (`benchmarks.worker`), and alone writes rows. All of
it may be killed at any time: what has a row is kept, and the same call goes on from there.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import math
import os
import selectors
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self, cast

import psutil

from baselines import registry
from benchmarks import environment, models
from benchmarks.results import SOURCE_CHANGED, ResultRow, Store, disk_said, identity, plain
from benchmarks.suites import Suite
from parapoint import files
from parapoint.errors import InputError
from parapoint.files import read_parameterized
from parapoint.surface import Surface

TIME_LIMIT = 1800.0
"""Seconds a cell may take unless said otherwise."""
METRICS_TIME_LIMIT = 120.0
"""Seconds that the metrics of one map may take; on real maps of 100k faces they take a few."""
GRACE = 15.0
"""Seconds past its limit after which a supervisor itself counts as hung."""
OUTPUT_KEPT = 1 << 16
"""Bytes of a method's output that are held; what came before is dropped."""
READERS = ("files", "mesh_formats", "point_formats", "surface")
"""Modules of `parapoint` that make a surface of a file."""
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
        methods: its methods.
        ran: rows of the cells that ran, in the order in which they ended.
        reasons: how many cells ran for which reason.
        kept: rows of the cells that needed no run.
        missing: the cases whose model could not be had, and how to get each.
        unmeasured: ids of the rows whose metrics could not be computed, and why.
        seconds: wall time of the run.
        method_seconds: wall time spent in methods, all cells together, / jobs.
    """

    suite: Suite
    methods: Sequence[Chosen]
    ran: list[ResultRow] = field(default_factory=list)
    reasons: Counter[str] = field(default_factory=Counter)
    kept: list[ResultRow] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    unmeasured: dict[str, str] = field(default_factory=dict)
    seconds: float = 0.0
    method_seconds: float = 0.0

    def spec(self, row: ResultRow) -> str:
        """The method of a row as it was asked for."""
        return next(
            (
                method.spec
                for method in self.methods
                if (method.name, method.params) == (row.method, row.params)
            ),
            row.method,
        )

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

    def measured(self, done: int, total: int) -> None:
        """After the cells: the metrics of `done` maps of `total` are known."""

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
        plugins: "FILE.py:Class" of methods to add, which run as well.
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
    summary = Summary(suite, chosen)
    with store.writing(), _Pool(store.folder / "cells", threads, progress) as pool:
        surfaces = _surfaces(store, suite.cases, loaded, summary)
        here = environment.environment() | limits | {"jobs": jobs, "threads": threads}
        todo = list(_todo(suite, chosen, surfaces, store=store, here=here, summary=summary))
        progress.planned(summary, len(todo))
        if todo:
            number = store.add_run(here | {"suite": suite.name})
            book = _Book(store, number, summary, progress)
            job = limits | {"plugins": [_absolute(plugin) for plugin in plugins]}
            tasks = [book.task(cell, job) for cell in todo if cell.row.surface_hash]
            for cell in todo:
                if not cell.row.surface_hash:
                    book.write(
                        cell, {"status": "skipped", "reason": summary.missing[cell.row.case]}
                    )
            pool.run(tasks, jobs)
        _measure(store, pool, summary, progress)
    summary.seconds = time.monotonic() - began
    summary.method_seconds /= jobs
    return summary


def _measure(store: Store, pool: _Pool, summary: Summary, progress: Progress) -> None:
    """Bring the metrics up to date, each map in a child process: a wild map can defeat a metric."""
    rows = store.unmeasured()
    values: dict[str, dict[str, float]] = {}
    # Another supervisor takes a second to start: it must have something to do.
    jobs = min(environment.cores(), 1 + len(rows) // 4)
    limits = {
        "time_limit": METRICS_TIME_LIMIT,
        "memory_limit": 0.8 * environment.memory() / jobs,
    }

    def ended(row: ResultRow) -> Callable[[dict[str, Any], str, Path], None]:
        def note(outcome: dict[str, Any], _: str, __: Path) -> None:
            values[row.id] = {k: float(v) for k, v in outcome.get("metrics", {}).items()}
            if outcome["status"] != "ok":
                summary.unmeasured[row.id] = outcome["reason"]
            progress.measured(len(values), len(rows))

        return note

    def began() -> None:
        progress.measured(len(values), len(rows))

    tasks = []
    for row in rows:
        files = {
            "surface": str(store.scored_path(row.surface_hash).resolve()),
            "measure": str(store.uv_path(row.id).resolve()),
            "reference": _reference(store, row),
        }
        tasks.append(_Task(limits | files, began, ended(row)))
    pool.run(tasks, jobs)
    store.metrics(values)


def _reference(store: Store, row: ResultRow) -> str:
    """Where the map lies that the row's surface came with; "" if none came."""
    path = store.reference_path(row.surface_hash)
    return str(path.resolve()) if path.exists() else ""


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
    chosen = []
    made = [(spec, *registry.method(spec)) for spec in dict.fromkeys(methods or suite.methods)]
    named = {name for _, name, _ in made}
    made += [(name, *registry.method(name)) for name in added if name not in named]
    for spec, name, method in made:
        params = plain(dataclasses.asdict(cast("Any", method)))
        chosen.append(Chosen(spec, name, params, registry.source_hash(method)))
    asked = suite.cases if cases is None else cases
    names = tuple(dict.fromkeys(models.canonical_name(case) for case in asked))
    asked_seeds = suite.seeds if seeds is None else tuple(dict.fromkeys(seeds))
    specs = tuple(method.spec for method in chosen)
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
    known = store.surface_hashes()
    readers = _readers_hash()
    before = dict(known)
    for case in cases:
        model = models.info(case)
        origin = f"{model.sha256} {readers}" if model else ""
        surface = loaded.get(case)
        if surface is None and origin in known:
            hashes[case] = known[origin]
            continue
        if surface is None:
            try:
                surface = models.load(case)
            except InputError as error:
                surface = error
        if isinstance(surface, InputError):
            summary.missing[case] = " ".join(str(surface).split())
            hashes[case] = ""
            continue
        hashes[case] = store.add_surface(surface)
        if (exact := models.exact_points(case)) is not None:
            store.add_exact(hashes[case], exact)
        if model and model.has_uv:
            store.add_reference(hashes[case], read_parameterized(models.path(case))[1])
        if model:
            known[origin] = hashes[case]
    if known != before:
        store.note_surfaces(known)
    return hashes


def _readers_hash() -> str:
    """Hash of the source that makes a surface of a file."""
    folder = Path(files.__file__).parent
    texts = [path.read_bytes() for path in sorted(folder.glob("*.py")) if path.stem in READERS]
    return hashlib.sha256(b"".join(texts)).hexdigest()[:16]


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
    if not cell.surface_hash:  # the model cannot be had now: what is known of it stays
        return ""
    if row.source_hash != cell.source_hash:
        return "method changed"
    if row.surface_hash != cell.surface_hash:
        return "model changed" if row.surface_hash else "model was missing"
    if row.reason == SOURCE_CHANGED:
        return "method changed"
    if row.status == "ok":
        return "" if store.uv_path(row.id).exists() else "map missing"
    there = runs[row.run] if 0 <= row.run < len(runs) else {}
    if any(there.get(name) != here[name] for name in environment.MACHINE):
        return f"{row.status} in another environment"
    limit = {"timeout": "time_limit", "out_of_memory": "memory_limit"}.get(row.status)
    if limit and here[limit] > there.get(limit, 0) * 1.01:  # the machine's own total may vary
        return "limit raised"
    return ""


@dataclass(frozen=True)
class _Task:
    """Something for a supervisor to do.

    Attributes:
        job: what the supervisor is told, its limits included.
        began: called when it is under way.
        ended: called with its outcome, the last lines printed and the file it may have written.
    """

    job: Mapping[str, Any]
    began: Callable[[], None]
    ended: Callable[[dict[str, Any], str, Path], None]


class _Slot:
    """A supervisor process, and the task that it is busy with."""

    def __init__(self, threads: int) -> None:
        """Start a supervisor whose children may use `threads` threads."""
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
        self.ready = False
        self.task: _Task | None = None
        self.folder = Path()
        self.started = 0.0

    @property
    def time_limit(self) -> float:
        """Seconds that the task may take."""
        return float(self.task.job["time_limit"]) if self.task else math.inf

    def give(self, task: _Task, folder: Path) -> None:
        """Begin a task, which may write into `folder`."""
        self.printed.clear()
        self.task = task
        self.folder = folder
        self.started = time.monotonic()
        job = {**task.job, "map": str(folder / "map.npz"), "work": str(folder / "work")}
        with contextlib.suppress(OSError):  # a supervisor that is gone is heard of next
            self.jobs.write(json.dumps(job).encode() + b"\n")

    def hear(self) -> list[dict[str, Any]] | None:
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


class _Pool:
    """Supervisors that work off tasks. A context manager: after it, no process is left."""

    def __init__(self, folder: Path, threads: int, progress: Progress) -> None:
        """Tasks write into folders below `folder`, which goes with the pool."""
        self.folder = folder
        self.threads = threads
        self.progress = progress
        self.selector = selectors.DefaultSelector()
        self.slots: set[_Slot] = set()

    def __enter__(self) -> Self:
        """Clear what a run that was killed has left."""
        shutil.rmtree(self.folder, ignore_errors=True)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End all supervisors and what runs below them."""
        for slot in self.slots:
            slot.close()
        self.selector.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def run(self, tasks: Sequence[_Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time."""
        waiting = deque(tasks)
        jobs = min(jobs, len(tasks))
        while waiting or self._busy():
            while len(self.slots) < jobs:
                self._open()
            for slot in self.slots:
                if waiting and slot.ready and not slot.task and self._busy() < jobs:
                    self._begin(slot, waiting.popleft())
            self._listen()
            self.progress.tick()

    def _busy(self) -> int:
        return sum(slot.task is not None for slot in self.slots)

    def _open(self) -> None:
        slot = _Slot(self.threads)
        self.slots.add(slot)
        self.selector.register(slot.replies, selectors.EVENT_READ, slot)
        self.selector.register(slot.output, selectors.EVENT_READ, slot)

    def _begin(self, slot: _Slot, task: _Task) -> None:
        with disk_said(self.folder):
            self.folder.mkdir(exist_ok=True)
            folder = Path(tempfile.mkdtemp(dir=self.folder)).resolve()
            (folder / "work").mkdir()
        slot.give(task, folder)
        task.began()

    def _listen(self) -> None:
        """Wait a moment for news, and deal with it."""
        for slot in {key.data for key, _ in self.selector.select(0.1)}:
            news = slot.hear()
            slot.drain()
            for outcome in news or ():
                slot.ready = True
                if slot.task is not None:
                    self._end(slot, outcome)
            if news is None:
                self._lost(slot)
        now = time.monotonic()
        for slot in [slot for slot in self.slots if now > slot.started + slot.time_limit + GRACE]:
            self._lost(slot)

    def _lost(self, slot: _Slot) -> None:
        """Deal with a supervisor that is gone or hangs: its task ends with it."""
        if slot.task is None:
            said = last_lines(slot.printed, lines=1)
            raise RuntimeError(f"benchmarks.worker ended unasked: {said}")
        if time.monotonic() > slot.started + slot.time_limit:
            reason = f"not done within the limit of {slot.time_limit:g} s, and hard to kill"
            self._end(slot, {"status": "timeout", "reason": reason})
        else:
            reason = "killed the process that watched over it"
            self._end(slot, {"status": "failed", "reason": reason})
        self.slots.discard(slot)
        self.selector.unregister(slot.replies)
        self.selector.unregister(slot.output)
        slot.close()

    def _end(self, slot: _Slot, outcome: dict[str, Any]) -> None:
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


class _Book:
    """Where the rows of one run go."""

    def __init__(self, store: Store, number: int, summary: Summary, progress: Progress) -> None:
        """`number` is the run's entry in the environment."""
        self.store = store
        self.number = number
        self.summary = summary
        self.progress = progress

    def task(self, cell: Cell, shared: Mapping[str, Any]) -> _Task:
        """What runs a cell and writes its row; `shared` holds the limits and plugins of all."""
        job = {
            **shared,
            "spec": cell.spec,
            "seed": cell.row.seed,
            "source_hash": cell.row.source_hash,
            "surface": str(self.store.surface_path(cell.row.surface_hash).resolve()),
            "reference": _reference(self.store, cell.row),
        }

        def ended(outcome: dict[str, Any], printed: str, path: Path) -> None:
            took = outcome.pop("took")
            self.summary.method_seconds += outcome.get("seconds") or took
            if outcome["status"] == "ok":
                self.store.add_map(cell.row.id, path)
                outcome["uv_file"] = f"uv/{cell.row.id}.npz"
            else:
                outcome["output"] = printed
            self.write(cell, outcome)

        return _Task(job, lambda: self.progress.started(cell), ended)

    def write(self, cell: Cell, outcome: Mapping[str, Any]) -> None:
        """Write the row of `cell`."""
        row = dataclasses.replace(cell.row, run=self.number, **outcome)
        self.store.append(row)
        self.summary.ran.append(row)
        self.progress.ended(cell, row)


def last_lines(printed: bytes | bytearray, lines: int = 20, characters: int = 4000) -> str:
    """The end of what a method printed."""
    text = printed.decode(errors="replace")[-characters:]
    return "\n".join(text.splitlines()[-lines:])
