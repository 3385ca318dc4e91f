"""What the tests of the store share: a square, its map, and a store to write into."""

from __future__ import annotations

import dataclasses

import pytest

from benchmarks.store.archives import (
    arrays_hash,
    map_arrays,
    trace_arrays,
    write_arrays,
)
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
FLAT = Parameterization(SQUARE.vertices[:, :2], SQUARE.faces)


def add(store: Store, result=FLAT, surface=SQUARE, *, status="ok", **changes) -> ResultRow:
    """Stores a result as a run does."""
    cell = {
        "suite": "trial",
        "case": "square",
        "method": "flat",
        "params": {"sizes": (1, 2)},
        "seed": 0,
        "source_hash": "abc",
        "surface_hash": store.add_surface(surface),
    } | changes
    row_id = identity(**cell)
    row = ResultRow(id=row_id, status=status, **cell)
    if status == "ok":
        path = store.folder / "map.npz"
        write_arrays(path, map_arrays(result) | trace_arrays(result.trace))
        store.add_map(row_id, path)
        digest = arrays_hash(map_arrays(result))
        row = dataclasses.replace(
            row, uv_file=f"uv/{row_id}.npz", uv_sha256=digest, report=result.report
        )
    store.append(row)
    return row


@pytest.fixture
def store(tmp_path):
    store = Store(tmp_path / "results")
    with store.writing():
        yield store
