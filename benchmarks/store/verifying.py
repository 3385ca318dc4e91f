"""Checks a results folder: each row against its files, and the metrics against the maps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    read_arrays,
    read_map,
    read_surface,
    surface_arrays,
)
from benchmarks.store.measuring import metrics_keys, row_metrics, stored_table, values_by_key
from benchmarks.store.results import Store
from benchmarks.store.rows import IDENTITY, ResultRow, identity, row_of
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

METRICS_TOLERANCE = 1e-9
"""Relative difference up to which a metric computed anew counts as the stored one. Libraries that
sum in another order differ by less; a wrong map differs by far more."""


def faults(store: Store, sample: int = 20) -> Iterator[str]:
    """What is wrong in a results folder, one line each.

    Args:
        store: the folder. Every row is checked against its files: hashes, shapes, finite values.
        sample: how many rows of `metrics.parquet`, spread evenly, are computed anew.
    """
    for number, line in enumerate(store.row_file.lines(), start=1):
        if row_of(line) is None:
            yield f"runs.jsonl, line {number}: no whole row"
    rows = store.rows()
    yield from file_faults(store, rows)
    yield from _metric_faults(store, rows, sample)


def file_faults(store: Store, rows: Sequence[ResultRow]) -> Iterator[str]:
    """What is wrong with the files of some rows, one line each: hashes, shapes, finite values."""
    sizes: dict[str, int] = {}
    for surface_hash in dict.fromkeys(row.surface_hash for row in rows if row.surface_hash):
        try:
            surface = read_surface(store.surface_path(surface_hash))
        except InputError as error:
            yield str(error)
            continue
        if arrays_hash(surface_arrays(surface))[: len(surface_hash)] != surface_hash:
            yield f"{store.surface_path(surface_hash)}: its content does not fit its name"
        for path in store.paths_of(surface_hash)[1:]:
            if path.exists():
                try:
                    read_arrays(path)
                except InputError as error:
                    yield str(error)
        sizes[surface_hash] = len(surface.faces if isinstance(surface, Mesh) else surface.points)
    for row in rows:
        for fault in _row_faults(store, row, sizes.get(row.surface_hash)):
            yield f"{row.case}, {row.method}, seed {row.seed} ({row.id}): {fault}"


def _row_faults(store: Store, row: ResultRow, size: int | None) -> Iterator[str]:
    """What is wrong with a row whose surface has `size` faces, or points; None if unknown."""
    if row.id != identity(**{name: getattr(row, name) for name in IDENTITY}):
        yield "its id is not that of its contents"
    if row.status != "ok":
        return
    try:
        result = read_map(store.uv_path(row.id))
    except InputError as error:
        yield str(error)
        return
    if arrays_hash(map_arrays(result)) != row.uv_sha256:
        yield f"{row.uv_file} is not the map that was written"
    found = len(result.corners if isinstance(result, Parameterization) else result.uv)
    if size is not None and found != size:
        yield f"{row.uv_file} has {found} rows for {size} faces or points"


def _metric_faults(store: Store, rows: list[ResultRow], sample: int) -> Iterator[str]:
    """Where `metrics.parquet` differs from what `sample` of the maps give."""
    known = values_by_key(stored_table(store))
    keys = metrics_keys(store, rows)
    measured = [row for row in rows if row.status == "ok" and keys[row.id] in known]
    places = np.linspace(0, len(measured) - 1, min(sample, len(measured))).astype(int)
    for row in (measured[place] for place in places):
        stored = known[keys[row.id]]
        for name, value in row_metrics(store, row).items():
            before = stored.get(name, math.nan)
            both_missing = math.isnan(value) and math.isnan(before)
            if not (both_missing or math.isclose(value, before, rel_tol=METRICS_TOLERANCE)):
                yield (
                    f"{row.case}, {row.method}, seed {row.seed} ({row.id}): {name} is "
                    f"{stored.get(name)} in metrics.parquet, {value} from the map"
                )
