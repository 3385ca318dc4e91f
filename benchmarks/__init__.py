"""Compare parameterization methods: `frame` reads the results of a run, commands do the rest."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["frame"]


def frame(folder: str | Path) -> pd.DataFrame:
    """Everything known of the cells of a results folder, as a pandas frame, one row a cell.

        >>> from benchmarks import frame
        >>> results = frame("results/smoke")
        >>> results.groupby("method")["angle_difference_mean"].median()

    Columns: suite, case, method, params (a JSON text), seed, status, reason, grade, seconds,
    cpu_seconds, peak_memory_mb, load; then every metric by its name, empty where it does not apply.

    Args:
        folder: a results folder. Metrics that it lacks are computed and kept there.

    Raises:
        InputError: it is no results folder.
    """
    import pandas as pd

    from benchmarks.metrics.grades import grade_of
    from benchmarks.metrics.table import METRICS
    from benchmarks.store.measuring import metrics
    from benchmarks.store.results import Store
    from parapoint.errors import InputError

    if not (Path(folder) / "runs.jsonl").is_file():
        raise InputError(f"{folder} is no results folder: it has no runs.jsonl")
    store = Store(folder)
    table = metrics(store)
    rows = {row.id: row for row in store.rows()}
    cells = [rows[row_id] for row_id in table["id"]]
    values = table[list(METRICS)]
    known = values.apply(lambda of: of.dropna().to_dict(), axis=1)
    grades = pd.Series([grade_of(row.method, of) for row, of in zip(cells, known, strict=True)])
    told = ("reason", "seconds", "cpu_seconds", "peak_memory_mb", "load")
    found = table[["suite", "case", "method", "params", "seed", "status"]].assign(
        grade=grades,
        **{name: [getattr(row, name) for row in cells] for name in told},
    )
    return found.join(values)
