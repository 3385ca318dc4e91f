"""What is wrong in a results folder is found."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.store import measuring, verifying
from benchmarks.store.archives import (
    map_arrays,
    write_arrays,
)
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud

from .conftest import FLAT, SQUARE, add


def damaged_map(store, row):
    path = store.uv_path(row.id)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def exchanged_map(store, row):
    write_arrays(store.uv_path(row.id), map_arrays(Parameterization(FLAT.uv * 2, FLAT.corners)))


def shortened_map(store, row):
    short = Parameterization(FLAT.uv, FLAT.corners[:1])
    write_arrays(store.uv_path(row.id), map_arrays(short))


def infinite_map(store, row):
    write_arrays(store.uv_path(row.id), map_arrays(FLAT) | {"uv": FLAT.uv + np.inf})


def missing_map(store, row):
    store.uv_path(row.id).unlink()


def exchanged_surface(store, row):
    arrays = {"vertices": SQUARE.vertices * 2, "faces": SQUARE.faces}
    write_arrays(store.surface_path(row.surface_hash), arrays)


def damaged_reference(store: Store, row: ResultRow) -> None:
    store.add_reference(row.surface_hash, FLAT)
    store.reference_path(row.surface_hash).write_bytes(b"PK")


def damaged_exact(store: Store, row: ResultRow) -> None:
    store.add_exact(row.surface_hash, PointCloud(SQUARE.vertices))
    store.exact_path(row.surface_hash).write_bytes(b"PK")


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (damaged_reference, "references/"),
        (damaged_exact, "exact/"),
        (damaged_map, "damaged"),
        (exchanged_map, "is not the map that was written"),
        (shortened_map, "has 1 rows for 2 faces"),
        (infinite_map, "must be finite"),
        (missing_map, "missing"),
        (exchanged_surface, "does not fit its name"),
    ],
)
def test_check_finds_what_is_wrong_with_a_file(store, damage, says):
    row = add(store)
    assert not list(verifying.faults(store))
    damage(store, row)
    assert any(says in fault for fault in verifying.faults(store))


def test_check_counts_the_points_of_a_cloud(store: Store) -> None:
    cloud = PointCloud(SQUARE.vertices)
    add(store, PointParameterization(SQUARE.vertices[:, :2]), cloud)
    assert not list(verifying.faults(store))
    add(store, PointParameterization(SQUARE.vertices[:3, :2]), cloud, seed=1)
    assert any("has 3 rows for 4 faces or points" in fault for fault in verifying.faults(store))


def test_check_finds_a_row_that_was_edited(store):
    add(store)
    path = store.folder / "runs.jsonl"
    path.write_text(path.read_text().replace('"seed": 0', '"seed": 1'))
    (fault,) = verifying.faults(store)
    assert "its id is not that of its contents" in fault


def test_check_finds_a_metric_that_was_edited_in_the_last_of_many_rows(store):
    rows = [add(store, seed=seed) for seed in range(7)]
    frame = measuring.metrics(store)
    stored = frame["symmetric_dirichlet"].to_numpy(copy=True)
    frame.loc[6, "symmetric_dirichlet"] = stored[6] * (1 + 1e-6)
    frame.to_parquet(store.folder / "metrics.parquet", index=False)
    (fault,) = verifying.faults(store)
    assert f"seed 6 ({rows[6].id}): symmetric_dirichlet is" in fault
    frame.loc[6, "symmetric_dirichlet"] = np.nan
    frame.to_parquet(store.folder / "metrics.parquet", index=False)
    assert len(list(verifying.faults(store))) == 1


def test_the_sample_of_the_metrics_is_spread_over_all_rows(store, monkeypatch):
    rows = [add(store, seed=seed) for seed in range(7)]
    measuring.metrics(store)
    computed = []
    monkeypatch.setattr(verifying, "row_metrics", lambda _, row: computed.append(row.seed) or {})
    for sample, seeds in {1: [0], 3: [0, 3, 6], 4: [0, 2, 4, 6], 20: list(range(7))}.items():
        computed.clear()
        assert not list(verifying._metric_faults(store, rows, sample))
        assert computed == seeds


def test_rounding_is_no_fault(store):
    add(store)
    frame = measuring.metrics(store)
    frame["symmetric_dirichlet"] *= 1 + 1e-12
    frame.to_parquet(store.folder / "metrics.parquet", index=False)
    assert not list(verifying.faults(store))


@pytest.mark.parametrize("digits", [8, 31])
def test_check_compares_the_whole_hash_of_a_surface(store, digits):
    row = add(store)
    name = row.surface_hash
    wrong = name[:digits] + format(15 - int(name[digits], 16), "x") + name[digits + 1 :]
    store.surface_path(name).rename(store.surface_path(wrong))
    add(store, seed=1, surface_hash=wrong)
    assert any("does not fit its name" in fault for fault in verifying.faults(store))
