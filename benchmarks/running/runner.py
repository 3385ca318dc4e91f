"""Runs the cells of a suite that a results folder does not have yet, each in its own process.

This process plans, hands cells to an executor (`benchmarks.running.executors`), and alone writes
rows. All of it may be killed at any time: what has a row is kept, and the same call goes on from
there.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.suites import Suite
from benchmarks.running import environment, executors, scratch
from benchmarks.running.cluster import WORKER_LOST
from benchmarks.running.tasks import Executor, MeasureJob, Outcome, RunJob, Task
from benchmarks.store.records import plain
from benchmarks.store.results import MISSING, SOURCE_CHANGED, ResultRow, Store, identity
from parapoint.errors import InputError
from parapoint.files.reading import faults_of, read_parameterized
from parapoint.sources import source_hash

TIME_LIMIT = 1800.0
"""Seconds a cell may take unless said otherwise."""
METRICS_TIME_LIMIT = 120.0
"""Seconds that the metrics of one map may take; on real maps of 100k faces they take a few."""
SLOW = ("torch", "pymeshlab")
"""Packages that are slow to import and start no thread by it: cells of methods that import them are
forked from a process that has them."""


@dataclass(frozen=True)
class Cell:
    """One case, method and seed to run.

    Attributes:
        row: its row before it has run: the identity is filled in, what comes after it is not.
        method: what it runs.
        why: why it runs: "new", or what changed since its last row.
    """

    row: ResultRow
    method: Chosen
    why: str


@dataclass(frozen=True)
class Chosen:
    """A method of a run: what was asked for, and what that is."""

    spec: str
    name: str
    params: Mapping[str, object]
    source_hash: str
    modules: tuple[str, ...]


@dataclass
class Summary:
    """What a run did.

    Attributes:
        suite: the suite, with the cases, methods and seeds that were asked for.
        methods: its methods.
        planned: the cells that had to run.
        ran: rows of the cells that ran, in the order in which they ended.
        kept: rows of the cells that needed no run.
        missing: the cases whose model could not be had, and how to get each.
        unmeasured: ids of the rows whose metrics could not be computed, and why.
        seconds: wall time of the run.
        method_seconds: wall time spent in methods, all cells together, / jobs.
    """

    suite: Suite
    methods: Sequence[Chosen]
    planned: list[Cell] = field(default_factory=list)
    ran: list[ResultRow] = field(default_factory=list)
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
    def reasons(self) -> Counter[str]:
        """How many cells had to run for which reason."""
        return Counter(cell.why for cell in self.planned)

    @property
    def rows(self) -> list[ResultRow]:
        """Rows of all cells of the run, kept or new."""
        return [*self.kept, *self.ran]


class Progress:
    """Hears how a run goes; this one says nothing."""

    def planned(self, summary: Summary) -> None:
        """It is known what is going to run."""

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
    executor: str = "local",
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
        executor: where cells run, as `executors.executor` says.
        jobs: cells at a time. More than one is faster and makes timings less honest.
        timeout: seconds a cell may take.
        memory: GB a cell's processes may hold; None: four fifths of the machine's, / jobs. An
            executor other than local must be told.
        progress: hears how it goes.

    Raises:
        InputError: a name is unknown, a file cannot be read, the folder is in use or from a newer
            version, the disk is full, an executor cannot be had. In the first two cases nothing
            is written.
    """
    began = time.monotonic()
    progress = progress or Progress()
    suite, chosen = _choice(suite, methods, cases, seeds, plugins)
    store = Store(folder)
    hands = executors.executor(
        executor, store.folder / scratch.NAME, jobs=jobs, memory=memory, tick=progress.tick
    )
    _check_readable(cases or (), store)
    memory_limit = _memory_limit(memory, jobs)
    summary = Summary(suite, chosen)
    with store.writing(), hands:
        surfaces = _surfaces(store, suite.cases, summary)
        here = environment.environment()
        here |= {"time_limit": timeout, "memory_limit": memory_limit}
        here |= {"executor": executor, "jobs": jobs, "threads": hands.threads}
        todo = summary.planned
        todo += _todo(suite, chosen, surfaces, store=store, here=here, summary=summary)
        progress.planned(summary)
        if todo:
            number = store.add_run(here | {"suite": suite.name})
            book = _Book(store, number, summary, progress)
            tasks = []
            for cell in todo:
                if cell.row.surface_hash:
                    job = _job(store, cell, plugins, timeout, memory_limit)
                    tasks.append(book.task(cell, job))
                else:
                    book.write(cell, Outcome("skipped", summary.missing[cell.row.case]))
            hands.run(tasks, jobs)
        _measure(store, hands, None if executor == "local" else memory, summary, progress)
    summary.seconds = time.monotonic() - began
    summary.method_seconds /= jobs
    return summary


def _measure(
    store: Store, hands: Executor, memory: float | None, summary: Summary, progress: Progress
) -> None:
    """Bring the metrics up to date, each map in a child process: a wild map can defeat a metric."""
    rows = store.unmeasured()
    values: dict[str, dict[str, float]] = {}
    # Another supervisor takes a second to start: it must have something to do.
    jobs = min(hands.width, 1 + len(rows) // 4)
    memory_limit = _memory_limit(memory, jobs)

    def began() -> None:
        progress.measured(len(values), len(rows))

    def ended(row: ResultRow, outcome: Outcome, _: Path) -> None:
        values[row.id] = dict(outcome.metrics)
        if outcome.status != "ok":
            summary.unmeasured[row.id] = outcome.reason
        progress.measured(len(values), len(rows))

    tasks = []
    for row in rows:
        job = MeasureJob(
            surface=store.scored_path(row.surface_hash),
            reference=_reference(store, row),
            uv=store.uv_path(row.id),
            time_limit=METRICS_TIME_LIMIT,
            memory_limit=memory_limit,
        )
        tasks.append(Task(job, began, functools.partial(ended, row)))
    hands.run(tasks, jobs)
    store.metrics(values)


def _job(
    store: Store, cell: Cell, plugins: Sequence[str], time_limit: float, memory_limit: float
) -> RunJob:
    """What an executor is told of a cell."""
    return RunJob(
        surface=store.surface_path(cell.row.surface_hash),
        reference=_reference(store, cell.row),
        time_limit=time_limit,
        memory_limit=memory_limit,
        spec=cell.method.spec,
        seed=cell.row.seed,
        source_hash=cell.row.source_hash,
        plugins=tuple(_absolute(plugin) for plugin in plugins),
    )


def _memory_limit(memory: float | None, jobs: int) -> float:
    """Bytes that a job may hold: `memory` GB, else its part of four fifths of the machine's."""
    return memory * 1e9 if memory else 0.8 * environment.memory() / jobs


def _reference(store: Store, row: ResultRow) -> Path | None:
    """The file of the map that the row's surface came with; None if it came with none."""
    path = store.reference_path(row.surface_hash)
    return path if path.exists() else None


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
        modules = tuple(module for module in SLOW if registry.imports(method, module))
        chosen.append(Chosen(spec, name, params, registry.source_hash(method), modules))
    asked = suite.cases if cases is None else cases
    names = tuple(dict.fromkeys(models.canonical_name(case) for case in asked))
    asked_seeds = suite.seeds if seeds is None else tuple(dict.fromkeys(seeds))
    specs = tuple(method.spec for method in chosen)
    return dataclasses.replace(suite, cases=names, methods=specs, seeds=asked_seeds), chosen


def _check_readable(cases: Sequence[str], store: Store) -> None:
    """Read what was asked for by name before anything is written, and keep none of it in memory.

    Raises:
        InputError: a file cannot be read, or every model is missing.
    """
    known, readers = store.surface_hashes(), source_hash("parapoint.files.reading")
    missing = []
    for case in cases:
        try:
            if _origin(case, readers) not in known:
                models.load(case)
        except models.MissingModelError as error:
            missing.append(error)
    if missing and len(missing) == len(cases):
        raise missing[0]


def _surfaces(store: Store, cases: Sequence[str], summary: Summary) -> dict[str, str]:
    """The hash of each case's surface, stored; "" where the model is missing."""
    hashes = {}
    known, readers = store.surface_hashes(), source_hash("parapoint.files.reading")
    before = dict(known)
    for case in cases:
        origin = _origin(case, readers)
        if origin in known:
            hashes[case] = known[origin]
            continue
        try:
            surface = models.load(case)
        except InputError as error:
            summary.missing[case] = " ".join(str(error).split())
            hashes[case] = ""
            continue
        hashes[case] = store.add_surface(surface)
        if (exact := models.exact_points(case)) is not None:
            store.add_exact(hashes[case], exact)
        model = models.info(case)
        if model and model.has_uv:
            store.add_reference(hashes[case], read_parameterized(models.path(case))[1])
        if origin:
            known[origin] = hashes[case]
    if known != before:
        store.note_surfaces(known)
    return hashes


def _origin(case: str, readers: str) -> str:
    """The content of a case's file and the hash of its readers, as one text; "" for what varies.

    Built-in surfaces and sampled clouds have no file, and a .gltf file names others.
    """
    model = models.info(case)
    path = Path(case)
    if model:
        return f"{model.sha256} {readers}"
    if models.is_made_in_memory(case) or path.suffix.lower() == ".gltf":
        return ""
    with faults_of(path), path.open("rb") as stream:
        content = hashlib.file_digest(stream, "sha256").hexdigest()
    return f"{content} {path.suffix.lower()} {readers}"


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
                    yield Cell(blank, method, why)
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
    if row.reason == WORKER_LOST:
        return "workers were lost"
    if row.status == "ok":
        return "" if store.uv_path(row.id).exists() else "map missing"
    there = runs[row.run] if 0 <= row.run < len(runs) else {}
    if any(there.get(name) != here[name] for name in environment.MACHINE):
        return f"{row.status} in another environment"
    if row.reason.startswith(MISSING):
        return "may be installed now"
    limit = {"timeout": "time_limit", "out_of_memory": "memory_limit"}.get(row.status)
    if limit and here[limit] > there.get(limit, 0) * 1.01:  # the machine's own total may vary
        return "limit raised"
    return ""


class _Book:
    """Where the rows of one run go."""

    def __init__(self, store: Store, number: int, summary: Summary, progress: Progress) -> None:
        """`number` is the run's entry in the environment."""
        self.store = store
        self.number = number
        self.summary = summary
        self.progress = progress

    def task(self, cell: Cell, job: RunJob) -> Task:
        """What runs a cell and writes its row."""

        def ended(outcome: Outcome, path: Path) -> None:
            self.summary.method_seconds += outcome.seconds or outcome.took
            if outcome.status == "ok":
                self.store.add_map(cell.row.id, path)
            self.write(cell, outcome)

        began = functools.partial(self.progress.started, cell)
        return Task(job, began, ended, cell.method.modules)

    def write(self, cell: Cell, outcome: Outcome) -> None:
        """Write the row of a cell."""
        is_ok = outcome.status == "ok"
        row = dataclasses.replace(
            cell.row,
            run=self.number,
            status=outcome.status,
            reason=outcome.reason,
            output="" if is_ok else outcome.printed,
            preprocessing=outcome.preprocessing,
            seconds=outcome.seconds,
            cpu_seconds=outcome.cpu_seconds,
            peak_memory_mb=outcome.peak_memory_mb,
            uv_file=f"uv/{cell.row.id}.npz" if is_ok else "",
            uv_sha256=outcome.uv_sha256,
            report=outcome.report,
            host=outcome.host,
        )
        self.store.append(row)
        self.summary.ran.append(row)
        self.progress.ended(cell, row)
