"""The result store: what was stored comes back, to one writer at a time."""

from __future__ import annotations

import dataclasses
import os

import numpy as np
import pytest

from benchmarks.store import provenance
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.surface import Mesh, PointCloud

from .conftest import FLAT, SQUARE, add


def test_what_is_stored_comes_back(store):
    trace = (
        TracePoint(0, 0.0, {"energy": 4.0}, FLAT.uv * 2),
        TracePoint(9, 1.5, {"energy": 3.0, "flips": 1.0}),
    )
    row = add(store, Parameterization(FLAT.uv, FLAT.corners, trace, {"weights": [1, 2]}))
    (read,) = Store(store.folder).rows()
    assert dataclasses.asdict(read) == dataclasses.asdict(row) | {"params": {"sizes": [1, 2]}}
    surface, result = store.surface(read), store.result(read)
    assert isinstance(surface, Mesh)
    assert isinstance(result, Parameterization)
    np.testing.assert_array_equal(surface.vertices, SQUARE.vertices)
    np.testing.assert_array_equal(surface.faces, SQUARE.faces)
    np.testing.assert_array_equal(result.uv, FLAT.uv)
    np.testing.assert_array_equal(result.corners, FLAT.corners)
    assert [point[:3] for point in result.trace] == [point[:3] for point in trace]
    np.testing.assert_array_equal(result.trace[0].uv, FLAT.uv * 2)
    assert result.trace[1].uv is None
    assert result.report == {"weights": [1, 2]}


def test_point_clouds_come_back_with_and_without_normals(store):
    points = np.arange(12.0).reshape(4, 3)
    image = PointParameterization(points[:, :2])
    for normals in (None, points[::-1]):
        row = add(store, image, PointCloud(points, normals))
        surface, result = store.surface(row), store.result(row)
        assert isinstance(surface, PointCloud)
        assert isinstance(result, PointParameterization)
        np.testing.assert_array_equal(surface.points, points)
        assert (surface.normals is None) == (normals is None)
    assert len({row.surface_hash for row in store.history()}) == 2


def test_one_writer_at_a_time(store):
    with pytest.raises(InputError, match="in use by another run"), Store(store.folder).writing():
        pass


def test_the_lock_ends_with_its_process(tmp_path):
    store = Store(tmp_path)
    child = os.fork()
    if child == 0:
        store.writing().__enter__()
        os._exit(9)  # without any clean-up, as after kill -9
    os.waitpid(child, 0)
    with store.writing():
        add(store)


def test_a_folder_of_a_newer_version_is_left_alone(tmp_path):
    (tmp_path / "environment.json").write_text(f'{{"format": {provenance.FORMAT + 1}, "runs": []}}')
    with pytest.raises(InputError, match="newer version"):
        Store(tmp_path)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="is a file"):
        Store(tmp_path / "file")


def test_every_run_has_its_own_entry(store):
    assert store.add_run({"python": "3.11"}) == 0
    assert store.add_run({"python": "3.12"}) == 1
    assert [run["python"] for run in store.environment()["runs"]] == ["3.11", "3.12"]


def test_surfaces_are_known_by_what_they_were_read_from_while_they_are_there(store):
    name = store.add_surface(SQUARE)
    store.note_surfaces({"file": name, "gone": "0" * 32, "evil": "../../x"})
    assert Store(store.folder).surface_hashes() == {"file": name}
    (store.folder / "surfaces.json").write_text("rubbish")
    assert store.surface_hashes() == {}
