"""The npz files of a results folder: found by their hash, and never written twice."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.store.archives import read_map, read_surface
from benchmarks.store.files import Files
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import PointCloud

from .conftest import FLAT, SQUARE, add

CLOUD = PointCloud(np.arange(12.0).reshape(4, 3))
EXACT = PointCloud(CLOUD.points + 1)


def test_what_is_stored_is_never_written_again(tmp_path):
    files = Files(tmp_path)
    name = files.add_surface(SQUARE)
    files.add_reference(name, FLAT)
    files.add_exact(name, EXACT)
    paths = [files.surface_path(name), files.reference_path(name), files.exact_path(name)]
    first = [path.stat().st_ino for path in paths]  # what is written anew is another file
    assert files.add_surface(SQUARE) == name
    files.add_reference(name, FLAT)
    files.add_exact(name, CLOUD)
    assert [path.stat().st_ino for path in paths] == first
    np.testing.assert_array_equal(read_surface(files.exact_path(name)).points, EXACT.points)


@pytest.mark.parametrize("damaged", [False, True])
def test_a_reference_is_renewed_once_it_is_another_or_damaged(tmp_path, damaged):
    files = Files(tmp_path)
    name = files.add_surface(SQUARE)
    files.add_reference(name, FLAT)
    if damaged:
        files.reference_path(name).write_bytes(b"PK")
    files.add_reference(name, Parameterization(FLAT.uv * 2, FLAT.corners))
    np.testing.assert_array_equal(read_map(files.reference_path(name)).uv, FLAT.uv * 2)


def test_a_noisy_cloud_is_scored_on_its_points_without_noise(tmp_path):
    files = Files(tmp_path)
    name = files.add_surface(CLOUD)
    assert files.scored_path(name) == files.surface_path(name)
    files.add_exact(name, EXACT)
    scored = read_surface(files.scored_path(name))
    np.testing.assert_array_equal(scored.points, EXACT.points)


def test_the_map_that_a_model_came_with_is_found_by_its_row(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        row = add(store)
        assert store.reference(row) is None
        store.add_reference(row.surface_hash, FLAT)
    np.testing.assert_array_equal(store.reference(row).uv, FLAT.uv)


def test_a_row_without_surface_or_map_says_so(tmp_path):
    store = Store(tmp_path)
    with store.writing():
        row = add(store, status="timeout", surface_hash="")
    with pytest.raises(InputError, match="square: no surface is stored"):
        store.surface(row)
    with pytest.raises(InputError, match=r"square, flat: no map is stored \(timeout\)"):
        store.result(row)
    assert store.reference(row) is None
