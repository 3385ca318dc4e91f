"""The metrics of stored maps, computed in processes of their own: a wild map may kill one."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.running import environment, scratch
from benchmarks.running.local import Local
from benchmarks.running.tasks import Executor, MeasureJob, Outcome, Task
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow

METRICS_TIME_LIMIT = 120.0
"""Wall time in seconds that the metrics of one map may take; 100,000 faces take a few seconds."""
MEMORY_SHARE = 0.8
"""Fraction of the machine's memory that all cells together may hold, if the user sets no limit."""
MAPS_TOGETHER = 8
"""Maps of one surface that one process measures: it reads the surface once for all of them."""
MAPS_PER_WORKER = 4
"""Maps to measure that justify another supervisor, which takes a second to start."""
Told = Callable[[int, int], None]
"""Hears how many of how many maps have been measured."""


def memory_limit(memory: float | None, jobs: int) -> float:
    """Bytes that a job may hold: `memory` in GB, or its part of the machine's memory."""
    return memory * 1e9 if memory else MEMORY_SHARE * environment.memory() / jobs


def reference(store: Store, row: ResultRow) -> Path | None:
    """The file of the map that the row's model came with; None if it came with none."""
    path = store.reference_path(row.surface_hash)
    return path if path.exists() else None


def scores(
    store: Store, rows: Sequence[ResultRow], workers: Executor, memory: float | None, told: Told
) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Every metric of the maps of `rows`, computed anew; and why there are none.

    Args:
        store: where the surfaces and the maps are.
        rows: rows with a map.
        workers: do the work.
        memory: GB that the metrics of a map may take; None for a part of the machine's.
        told: hears of each map.

    Returns:
        By row id, the metrics by name, none where they could not be computed; and the reasons.
    """
    values: dict[str, dict[str, float]] = {}
    reasons: dict[str, str] = {}
    alone: list[Task] = []
    jobs = min(workers.width, 1 + len(rows) // MAPS_PER_WORKER)

    def task(some: Sequence[ResultRow]) -> Task:
        surface = some[0].surface_hash
        job = MeasureJob(
            surface=store.scored_path(surface),
            reference=reference(store, some[0]),
            maps=tuple(store.uv_path(row.id) for row in some),
            time_limit=METRICS_TIME_LIMIT * len(some),
            memory_limit=memory_limit(memory, jobs),
        )
        return Task(job, began, functools.partial(ended, some))

    def began() -> None:
        told(len(values), len(rows))

    def ended(some: Sequence[ResultRow], outcome: Outcome, _: Path) -> None:
        is_ok = outcome.status == "ok" and len(outcome.metrics) == len(some)
        if is_ok:
            for row, found in zip(some, outcome.metrics, strict=True):
                values[row.id] = dict(found)
        elif len(some) > 1:  # one of them spoilt it for the others
            alone.extend(task([row]) for row in some)
        else:
            (row,) = some
            values[row.id] = {}
            reasons[row.id] = outcome.reason or "its metrics were lost"
        told(len(values), len(rows))

    surfaces: dict[str, list[ResultRow]] = {}
    for row in rows:
        surfaces.setdefault(row.surface_hash, []).append(row)
    together = [
        task(of_one[start : start + MAPS_TOGETHER])
        for of_one in surfaces.values()
        for start in range(0, len(of_one), MAPS_TOGETHER)
    ]
    workers.run(together, jobs)
    workers.run(alone, jobs)
    return values, reasons


def scored_here(
    store: Store, rows: Sequence[ResultRow], told: Told
) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """As `scores`, on all processors of this machine; scratch files lie in the store's folder."""
    with Local(store.folder / scratch.NAME, 1, lambda: None) as workers:
        return scores(store, rows, workers, None, told)
