"""The mesh of a fitted map: whole, in its place, and the right side up."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases.builtin import BUILTIN
from parapoint import ComputedMap, Mesh, Parameterization, ParaPoint, PointCloud
from parapoint.estimator import load
from parapoint.surfaces.parameterization import Charted

WAVY = BUILTIN["wavy_sheet"]()
RNG = np.random.default_rng(0)
SHEET = np.column_stack([RNG.random((300, 2)) * [4, 2], np.zeros(300)]) + np.array([50, 60, 70])


def signed_area(charted: Charted) -> float:
    """Area of the map, negative where it is mirrored."""
    a, b, c = (charted.map.uv[charted.map.corners[:, k]] for k in range(3))
    first, second = b - a, c - a
    return float((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum() / 2)


def test_a_mesh_of_each_component_stands_beside_the_others() -> None:
    model = ComputedMap(components="each").fit(np.concatenate([SHEET, SHEET + np.array([0, 0, 9])]))
    mesh, own = model.mesh()
    assert mesh.component_count == 2
    assert own.charts().max() == 1
    assert_allclose(np.unique(mesh.vertices[:, 2]), [70, 79], atol=1e-9)
    assert_allclose(signed_area(model.mesh()), mesh.face_areas.sum(), rtol=1e-6)
    # What `transform` says of the points is what the mesh says of its vertices.
    uv = np.empty((len(mesh.vertices), 2))
    uv[mesh.faces] = own.uv[own.corners]
    assert_allclose(model.transform(mesh.vertices), uv, atol=1e-6)


@pytest.mark.parametrize("up", [1.0, -1.0])
def test_the_map_turns_as_the_normals_do(up) -> None:
    cloud = PointCloud(SHEET, np.tile([0, 0, up], (300, 1)))
    model = ComputedMap().fit(cloud)
    mesh = model.mesh().mesh
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    assert np.sign(np.cross(b - a, c - a)[:, 2]).tolist() == [up] * len(mesh.faces)
    assert signed_area(model.mesh()) > 0
    uv = model.transform(SHEET)
    assert_allclose(model.inverse_transform(uv), SHEET, atol=1e-6)


@pytest.mark.parametrize("is_turned", [False, True])
def test_the_map_turns_as_the_faces_do(is_turned) -> None:
    faces = WAVY.faces[:, ::-1] if is_turned else WAVY.faces
    uv = ComputedMap(points=400).fit(Mesh(WAVY.vertices, faces)).transform(WAVY.vertices)
    assert signed_area(Charted(WAVY, Parameterization(uv, faces))) > 0


def test_tiles_without_normals_all_face_up() -> None:
    for seed in range(3):
        tile = np.random.default_rng(seed).random((200, 3)) * np.array([4, 4, 0])
        tiles = np.concatenate([tile, tile + np.array([9, 0, 0])])
        mesh = ComputedMap(components="each").fit(tiles).mesh().mesh
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        assert np.cross(b - a, c - a)[:, 2].min() > 0


@pytest.mark.parametrize("preset", ["paper", "learned"])
def test_a_trained_map_turns_as_the_normals_do_and_comes_back(preset, tmp_path) -> None:
    model = ParaPoint(preset, points=150, iterations=4, device="cpu")
    maps, back = {}, {}
    for up in (1.0, -1.0):
        model.fit(PointCloud(SHEET, np.tile([0, 0, up], (300, 1))))
        maps[up] = model.transform(SHEET)
        back[up] = model.inverse_transform(maps[up])
        model.save(tmp_path / f"{up}")
        assert_allclose(load(tmp_path / f"{up}").transform(SHEET), maps[up])
    assert_allclose(maps[-1.0], maps[1.0] * np.array([-1, 1]))
    assert_allclose(back[-1.0], back[1.0])
    uv = model.fit(WAVY).transform(WAVY.vertices)
    assert signed_area(Charted(WAVY, Parameterization(uv, WAVY.faces))) > 0


def test_turned_is_the_other_side_and_turned_twice_the_same() -> None:
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    once = Charted(mesh, Parameterization(mesh.vertices[:, :2], mesh.faces)).turned()
    assert once.mesh.faces.tolist() == [[2, 1, 0]]
    assert signed_area(once) == 0.5
    assert once.turned().map.uv.tolist() == mesh.vertices[:, :2].tolist()
