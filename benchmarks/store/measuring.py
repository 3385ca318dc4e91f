"""The metrics of a results folder: computed from the stored maps, and kept in `metrics.parquet`.

Since metrics come from stored maps, a new metric needs no method to run again. Each row of the
table has a key (`metrics_key`) that changes with whatever its values depend on.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from benchmarks.store.archives import disk_said, read_surface, replacing
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.sources import source_hash
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

if TYPE_CHECKING:
    import pandas as pd

IDENTITY_COLUMNS = ("suite", "case", "method", "params", "seed", "status")
"""The first columns of the table."""
KEY_COLUMNS = ("id", "metrics_key")
"""The last columns of the table."""
DAMAGED = " damaged"
"""Ends the key of a row whose files could not be read, so that the next time tries it again."""
_log = logging.getLogger("parapoint")


def metrics(
    store: Store, measured_elsewhere: Mapping[str, Mapping[str, float]] | None = None
) -> pd.DataFrame:
    """One row a cell: suite, case, method, params, seed, status, every metric by name, id.

    `params` is a JSON string; a metric that does not apply is null. Only what `metrics.parquet`
    lacks, or what has changed since, is computed; the file is brought up to date.

    Args:
        store: the rows and the maps.
        measured_elsewhere: by row id, metrics that have been computed already. An empty entry says
            that they could not be: they are null in the table.
    """
    import pandas as pd

    from benchmarks.metrics.table import METRICS

    table = stored_table(store)
    keys = metrics_keys(store, rows := store.rows())
    if table is not None and table["metrics_key"].tolist() == [keys[row.id] for row in rows]:
        return table
    known = values_by_key(table)
    records: list[dict[str, object]] = []
    for row in rows:
        key = keys[row.id]
        if key in known:
            values = known[key]
        else:
            given = (measured_elsewhere or {}).get(row.id)
            values = row_metrics(store, row) if given is None else dict(given)
            if given is None and row.uv_sha256 and not values:
                key += DAMAGED
        names = (_encodable(name) for name in (row.suite, row.case, row.method))
        cell = (*names, json.dumps(row.params), row.seed, row.status)
        start = dict(zip(IDENTITY_COLUMNS, cell, strict=True))
        records.append({**start, **values, "id": row.id, "metrics_key": key})
    extra = {name for record in records for name in record}
    extra -= {*IDENTITY_COLUMNS, *METRICS, *KEY_COLUMNS}
    numbers = [*METRICS, *sorted(extra)]
    frame = pd.DataFrame.from_records(records, columns=[*IDENTITY_COLUMNS, *numbers, *KEY_COLUMNS])
    frame = frame.astype(dict.fromkeys(numbers, "float64") | {"seed": "int64"})
    _write(store, frame)
    return frame


def _encodable(name: str) -> str:
    """A name as UTF-8 can hold it: that of a file may have bytes that are no text."""
    return name.encode(errors="backslashreplace").decode()


def unmeasured(store: Store) -> list[ResultRow]:
    """The rows with a map whose metrics are missing in the table, or come from other sources."""
    frame = stored_table(store)
    known = set() if frame is None else set(frame["metrics_key"])
    keys = metrics_keys(store, rows := store.rows())
    return [row for row in rows if row.uv_sha256 and keys[row.id] not in known]


def measured(
    surface: Surface,
    result: Parameterization | PointParameterization,
    reference: Parameterization | None = None,
) -> dict[str, float]:
    """Every metric of a map; with a reference, those against it as well.

    Raises:
        InputError: the map is not one of this surface.
    """
    from benchmarks.metrics import evaluation

    if isinstance(surface, Mesh) and isinstance(result, Parameterization):
        return evaluation.evaluate(surface, result, reference)
    if isinstance(surface, PointCloud) and isinstance(result, PointParameterization):
        return evaluation.evaluate_points(surface, result)
    raise InputError("a map of a mesh for a point cloud, or the other way round")


def row_metrics(store: Store, row: ResultRow) -> dict[str, float]:
    """Every metric of a row's map; none if it has no map, or if its files are damaged."""
    if not row.uv_sha256:
        return {}
    try:
        surface = read_surface(store.scored_path(row.surface_hash))
        return measured(surface, store.result(row), store.reference(row))
    except InputError as error:
        _log.warning("%s, %s: no metrics: %s", row.case, row.method, error)
        return {}


def metrics_keys(store: Store, rows: Sequence[ResultRow]) -> dict[str, str]:
    """By row id, a hash of all that a row's metrics depend on: map, references, their source."""
    source = source_hash("benchmarks.metrics.evaluation")
    references = {
        path.stem: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in (store.folder / "references").glob("*.npz")
        if path.is_file()
    }
    exact = {path.stem for path in (store.folder / "exact").glob("*.npz")}
    texts = {
        row.id: f"{row.id} {row.uv_sha256} {references.get(row.surface_hash, False)} "
        f"{row.surface_hash in exact} {source}"
        for row in rows
    }
    return {key: hashlib.sha256(text.encode()).hexdigest()[:32] for key, text in texts.items()}


def values_by_key(table: pd.DataFrame | None) -> dict[str, dict[str, float]]:
    """The metrics in a table, by `metrics_key` and name."""
    if table is None:
        return {}
    values = table.drop(columns=[*IDENTITY_COLUMNS, "id"]).set_index("metrics_key")
    return {str(key): record for key, record in values.to_dict("index").items()}  # type: ignore[misc]


def stored_table(store: Store) -> pd.DataFrame | None:
    """The content of `metrics.parquet`; None if the file is missing, or damaged with a warning."""
    import pandas as pd
    import pyarrow as pa

    path = store.folder / "metrics.parquet"
    try:
        frame = pd.read_parquet(path)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, pa.ArrowException):
        frame = pd.DataFrame()
    columns = list(frame.columns)
    numbers = columns[len(IDENTITY_COLUMNS) : -len(KEY_COLUMNS)]
    whole = columns == [*IDENTITY_COLUMNS, *numbers, *KEY_COLUMNS]
    whole = whole and frame["metrics_key"].is_unique
    if not whole or set(map(str, frame[numbers].dtypes)) - {"float64"}:
        _log.warning("%s: damaged; computed anew", path)
        return None
    return frame


def _write(store: Store, frame: pd.DataFrame) -> None:
    """Replace `metrics.parquet`; a folder that may only be read is left as it is."""
    path = store.folder / "metrics.parquet"
    content = io.BytesIO()
    frame.to_parquet(content, index=False)
    with contextlib.suppress(PermissionError), disk_said(path), replacing(path) as stream:
        stream.write(content.getbuffer())
