"""Runs the cells of a suite that a results folder lacks, each in a process of its own.

The process of the run plans the cells (`benchmarks.running.planning`), hands them to an executor
(`benchmarks.running.executors`), and is the only one to write rows. It may be killed at any time: a
cell that has its row is done, and the same call goes on with the others.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from benchmarks.cases.suites import Suite
from benchmarks.metrics.table import METRICS
from benchmarks.running import environment, environments, executors, planning, scoring, scratch
from benchmarks.running.environments import Environment
from benchmarks.running.planning import Cell, Chosen
from benchmarks.running.tasks import Executor, Outcome, RunJob, Task
from benchmarks.store import measuring, versions
from benchmarks.store.results import Store
from benchmarks.store.rows import MISSING, ResultRow
from parapoint.method import MissingError
from parapoint.parameters import LONGEST_SECONDS, MOST_MEMORY, check_number, check_whole

TIME_LIMIT = 1800.0
"""Wall time in seconds that a cell may take, where the user sets no other limit."""
MOST_JOBS = 4096
"""Most cells that may be asked to run at a time."""


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
        metrics: the metrics of each row that has a map, by its id and their names.
        jobs: how many cells ran at a time.
        seconds: wall time of the run.
        method_seconds: wall time spent in methods, summed over the cells, / jobs.
    """

    suite: Suite
    methods: Sequence[Chosen]
    planned: list[Cell] = field(default_factory=list)
    ran: list[ResultRow] = field(default_factory=list)
    kept: list[ResultRow] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)
    unmeasured: dict[str, str] = field(default_factory=dict)
    metrics: dict[str, dict[str, float]] = field(default_factory=dict)
    jobs: int = 1
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
    """What a run reports to while it goes on. This one says nothing; subclasses do."""

    def installing(self, requirements: Sequence[str], folder: Path) -> None:
        """An environment that methods need is about to be made."""

    def planned(self, summary: Summary) -> None:
        """The run knows which cells it has to do."""

    def started(self, cell: Cell) -> None:
        """A cell starts."""

    def ended(self, cell: Cell, row: ResultRow) -> None:
        """A cell has ended, and its row is written."""

    def measured(self, done: int, total: int) -> None:
        """After all cells: the metrics of `done` of `total` maps are known."""

    def tick(self) -> None:
        """Called several times a second."""


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
        jobs: how many cells run at a time. More than one is faster, and makes timings less honest.
        timeout: wall time in seconds that a cell may take.
        memory: GB that a cell's processes may hold together. None divides a part
            of the machine's (`scoring.MEMORY_SHARE`) by `jobs`; only the local executor can do so.
        progress: hears how the run goes.

    Raises:
        InputError: a number is out of range, a name is unknown, a file cannot be read, the folder
            is in use or from a newer version, the disk is full, or the executor is not available.
            In the first three cases nothing has been written.
    """
    began = time.monotonic()
    progress = progress or Progress()
    check_whole("jobs", jobs, 1, MOST_JOBS)
    check_number("timeout", timeout, most=LONGEST_SECONDS, above=True)
    if memory is not None:
        check_number("memory", memory, most=MOST_MEMORY, above=True)
    suite, chosen = planning.choice(suite, methods, cases, seeds, plugins)
    store = Store(folder)
    workers = executors.executor(
        executor, store.folder / scratch.NAME, jobs=jobs, memory=memory, tick=progress.tick
    )
    planning.check_readable(cases or (), store)
    memory_limit = scoring.memory_limit(memory, jobs)
    summary = Summary(suite, chosen, jobs=jobs)
    with store.writing(), workers:
        hashes, summary.missing = planning.surfaces(store, suite.cases)
        here = environment.environment()
        here |= {"time_limit": timeout, "memory_limit": memory_limit}
        here |= {"executor": executor, "jobs": jobs, "threads": workers.threads}
        todo, summary.kept = planning.plan(suite, chosen, hashes, store, here)
        summary.planned = todo
        planning.mend(store, todo)
        progress.planned(summary)
        if todo:
            made, refused = _environments(todo, progress, is_local=executor == "local")
            here |= {"environments": {", ".join(key): made[key].versions for key in made}}
            number = store.add_run(here | versions.noted(suite.name))
            book = _Book(store, number, summary, progress)
            tasks = []
            for cell in todo:
                needed = cell.method.environment
                if not cell.row.surface_hash:
                    book.write(cell, Outcome("skipped", summary.missing[cell.row.case]))
                elif needed in refused:
                    book.write(cell, Outcome("skipped", MISSING + refused[needed]))
                else:
                    job = _job(store, cell, plugins, timeout, memory_limit)
                    python = str(made[needed].interpreter) if needed else sys.executable
                    tasks.append(book.task(cell, job, python))
            workers.run(tasks, jobs)
        _measure(store, workers, None if executor == "local" else memory, summary, progress)
    summary.seconds = time.monotonic() - began
    summary.method_seconds /= jobs
    return summary


def _environments(
    todo: Sequence[Cell], progress: Progress, *, is_local: bool
) -> tuple[dict[tuple[str, ...], Environment], dict[tuple[str, ...], str]]:
    """The environments that some cells need, by requirements, and why others cannot be had."""
    made, refused = {}, {}
    wanted = [cell.method.environment for cell in todo if cell.row.surface_hash]
    for needed in filter(None, dict.fromkeys(wanted)):
        if not is_local:
            refused[needed] = (
                f"{', '.join(needed)}: environments are made by --executor local alone"
            )
            continue
        try:
            made[needed] = environments.made(needed, partial(progress.installing, needed))
        except MissingError as error:
            refused[needed] = str(error)
    return made, refused


def _measure(
    store: Store, workers: Executor, memory: float | None, summary: Summary, progress: Progress
) -> None:
    """Bring the metrics up to date, and note those of the run's rows."""
    values, summary.unmeasured = scoring.scores(
        store, measuring.unmeasured(store), workers, memory, progress.measured
    )
    table = measuring.metrics(store, values)
    ids = {row.id for row in summary.rows if row.status == "ok"}
    known = table[table["id"].isin(ids)]
    records = known[list(METRICS)].to_dict("records")
    summary.metrics = {
        row_id: {str(name): float(value) for name, value in record.items()}
        for row_id, record in zip(known["id"], records, strict=True)
    }


def _job(
    store: Store, cell: Cell, plugins: Sequence[str], time_limit: float, memory_limit: float
) -> RunJob:
    """The job that runs a cell."""
    return RunJob(
        surface=store.surface_path(cell.row.surface_hash),
        reference=scoring.reference(store, cell.row),
        time_limit=time_limit,
        memory_limit=memory_limit,
        spec=cell.method.spec,
        seed=cell.row.seed,
        source_hash=cell.row.source_hash,
        plugins=tuple(_absolute(plugin) for plugin in plugins),
    )


def _absolute(plugin: str) -> str:
    """The plugin "FILE.py:Class" by its absolute path, since cells run in other folders."""
    path, colon, name = plugin.rpartition(":")
    return f"{Path(path).resolve()}{colon}{name}"


class _Book:
    """Writes the rows of one run.

    Attributes:
        store: where they go.
        number: the run's entry in the store's environment.
        summary: where they are noted too.
        progress: hears of each.
    """

    def __init__(self, store: Store, number: int, summary: Summary, progress: Progress) -> None:
        self.store = store
        self.number = number
        self.summary = summary
        self.progress = progress

    def task(self, cell: Cell, job: RunJob, interpreter: str) -> Task:
        """The task that does `job` by a Python and writes the row of `cell`."""

        def ended(outcome: Outcome, path: Path) -> None:
            self.summary.method_seconds += outcome.seconds or outcome.took
            if outcome.status == "ok":
                try:
                    self.store.add_map(cell.row.id, path)
                except FileNotFoundError:
                    reason = "its map was gone, or no file, once it had ended"
                    outcome = dataclasses.replace(outcome, status="failed", reason=reason)
            self.write(cell, outcome)

        began = partial(self.progress.started, cell)
        return Task(job, began, ended, cell.method.modules, interpreter)

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
            load=outcome.load,
            peak_memory_mb=outcome.peak_memory_mb,
            uv_file=f"uv/{cell.row.id}.npz" if is_ok else "",
            uv_sha256=outcome.uv_sha256 if is_ok else "",
            report=outcome.report,
            host=outcome.host,
        )
        self.store.append(row)
        self.summary.ran.append(row)
        self.progress.ended(cell, row)
