"""Caches in a results folder carry their hash: a changed one is told apart and made anew."""

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks.running import planning
from benchmarks.store import measuring, verifying
from benchmarks.store.archives import SEAL, read_arrays, write_arrays
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import PointCloud
from parapoint.testing import irregular_disk


def changed(path: Path) -> None:
    """Other numbers in a file whose archive is whole: its checksums are right."""
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    name = next(name for name, array in arrays.items() if array.dtype.kind == "f")
    arrays[name] = arrays[name] * 1.25
    np.savez(path, **arrays)


@pytest.fixture
def store(tmp_path: Path) -> Store:
    mesh = irregular_disk()
    store = Store(tmp_path)
    store.add_reference("0" * 32, Parameterization(mesh.vertices[:, :2], mesh.faces))
    store.add_exact("0" * 32, PointCloud(mesh.vertices))
    return store


@pytest.mark.parametrize("place", ["reference_path", "exact_path"])
def test_a_changed_cache_is_told(store: Store, place: str) -> None:
    path = getattr(store, place)("0" * 32)
    assert SEAL not in read_arrays(path)
    changed(path)
    with pytest.raises(InputError, match="does not fit its hash"):
        read_arrays(path)


def test_integers_of_any_size_fit_their_seal(tmp_path: Path) -> None:
    arrays = {"small": np.arange(5), "large": np.array([2**40]), "none": np.zeros((0, 3))}
    write_arrays(tmp_path / "a.npz", arrays, sealed=True)
    assert {name: array.tolist() for name, array in read_arrays(tmp_path / "a.npz").items()} == {
        name: array.tolist() for name, array in arrays.items()
    }


@pytest.mark.parametrize("place", ["surface_path", "exact_path"])
def test_a_damaged_cache_is_made_anew_when_it_is_planned(tmp_path: Path, place: str) -> None:
    store, case = Store(tmp_path / "results"), "saddle@noise=0.01"
    hashes, _ = planning.surfaces(store, [case])
    path = getattr(store, place)(hashes[case])
    changed(path)
    assert not store.is_whole(hashes[case])
    assert planning.surfaces(store, [case])[0] == hashes
    assert store.is_whole(hashes[case])


def test_metrics_of_a_damaged_file_are_tried_again(tmp_path: Path) -> None:
    from benchmarks.cases.suites import Suite
    from benchmarks.checks import instant
    from benchmarks.running import runner

    suite = Suite("trial", "A trial", ("half_cylinder",), (), (0,))
    runner.run(suite, tmp_path, plugins=[f"{instant.__file__}:Instant"])
    store = Store(tmp_path)
    (row,) = store.rows()
    path = store.uv_path(row.id)
    whole = path.read_bytes()
    expected = measuring.metrics(store)["angle_difference_mean"].tolist()
    changed(path)
    (tmp_path / "metrics.parquet").unlink()
    assert list(verifying.faults(store))
    assert measuring.metrics(store)["angle_difference_mean"].isna().all()
    path.write_bytes(whole)
    assert measuring.metrics(store)["angle_difference_mean"].tolist() == expected


@pytest.mark.parametrize("name", ["environment.json", "uv/a.npz"])
def test_a_pipe_in_place_of_a_file_is_refused_and_not_waited_for(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    os.mkfifo(path)
    with pytest.raises(InputError, match="a pipe"):
        read_arrays(path) if path.suffix == ".npz" else Store(tmp_path).environment()
