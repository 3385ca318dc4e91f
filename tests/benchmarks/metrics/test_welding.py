import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases.builtin import grid_faces
from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.state import MapState
from parapoint import Mesh, Parameterization
from parapoint.surfaces.places import places
from parapoint.testing import sphere


def unwelded(mesh: Mesh, map_: Parameterization) -> tuple[Mesh, Parameterization]:
    """The same with a vertex and a row of uv for each corner."""
    corners = np.arange(3 * len(mesh.faces)).reshape(-1, 3)
    vertices = mesh.vertices[mesh.faces.reshape(-1)]
    return Mesh(vertices, corners), Parameterization(map_.uv[map_.corners.reshape(-1)], corners)


def split_at_seams(mesh: Mesh, map_: Parameterization) -> tuple[Mesh, Parameterization]:
    """The same with one vertex for each row of uv, as game engines write it."""
    vertices = np.empty((len(map_.uv), 3))
    vertices[map_.corners] = mesh.vertices[mesh.faces]
    return Mesh(vertices, map_.corners), map_


def flattened_sphere() -> tuple[Mesh, Parameterization]:
    mesh = sphere()
    return mesh, Parameterization(mesh.vertices[:, :2], mesh.faces)


def cut_sphere() -> tuple[Mesh, Parameterization]:
    """A globe of 24 x 12 fields in longitude and latitude, cut along one meridian."""
    i, j = np.meshgrid(np.arange(25), np.arange(1, 12), indexing="ij")
    longitude, latitude = 2 * np.pi * i / 24, np.pi * j / 12
    uv = np.stack([longitude.ravel(), latitude.ravel()], axis=1)
    x, y = np.cos(longitude % (2 * np.pi)), np.sin(longitude % (2 * np.pi))
    points = np.stack([x * np.sin(latitude), y * np.sin(latitude), np.cos(latitude)], axis=2)
    points[-1] = points[0]
    faces = grid_faces(25, 11)
    place = places(points.reshape(-1, 3))
    vertices = np.empty((place.max() + 1, 3))
    vertices[place] = points.reshape(-1, 3)
    return Mesh(vertices, place[faces]), Parameterization(uv, faces)


@pytest.mark.parametrize("made", [flattened_sphere, cut_sphere])
@pytest.mark.parametrize("written", [unwelded, split_at_seams])
def test_one_map_has_one_set_of_numbers_however_its_vertices_are_split(made, written):
    mesh, map_ = made()
    expected = evaluate(mesh, map_)
    found = evaluate(*written(mesh, map_))
    for name, value in expected.items():
        assert_allclose(found[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


def test_a_projection_of_a_sphere_is_half_flipped_also_as_a_soup():
    values = evaluate(*unwelded(*flattened_sphere()))
    assert values["flipped_fraction"] == pytest.approx(0.5, abs=0.05)
    assert values["chart_count"] == 1


def test_a_meridian_that_splits_vertices_is_a_seam():
    # 150° of a half circle of radius 1 in ten chords: twenty times the sine of 7.5°.
    mesh, map_ = split_at_seams(*cut_sphere())
    state = MapState(mesh, map_)
    assert state.welded == 11
    length = 20 * np.sin(np.pi / 24)
    area = np.sqrt(state.mesh.face_areas.sum())
    assert_allclose(evaluate(mesh, map_)["seam_length"], length / area)


def test_a_mesh_without_doubled_vertices_stays_as_it_is():
    mesh, map_ = flattened_sphere()
    state = MapState(mesh, map_)
    assert state.mesh is mesh
    assert state.parameterization is map_
    assert state.welded == 0


def test_what_single_precision_makes_of_a_closed_ring_is_welded():
    # The globe in single precision: at 2π the sine is 1.7e-7 and not 0, at the poles there are 25
    # vertices with as many uv. Nothing is cut but the one meridian, from pole to pole.
    i, j = np.meshgrid(np.arange(25), np.arange(13), indexing="ij")
    longitude = (2 * np.pi * i / 24).astype(np.float32)
    latitude = (np.pi * j / 12).astype(np.float32)
    x, y = np.cos(longitude) * np.sin(latitude), np.sin(longitude) * np.sin(latitude)
    points = np.stack([x, y, np.cos(latitude)], axis=2).reshape(-1, 3)
    uv = np.stack([longitude.ravel(), latitude.ravel()], axis=1)
    faces = grid_faces(25, 13)
    state = MapState(Mesh(points, faces), Parameterization(uv, faces))
    assert state.mesh.component_count == 1
    assert len(state.parameterization.seams(state.mesh)) == 12
    values = evaluate(Mesh(points, faces), Parameterization(uv, faces))
    assert values["seam_length"] == pytest.approx(0.89, abs=0.01)
    assert values["chart_count"] == 1


def test_vertices_that_are_near_but_apart_stay_so():
    # A strip of squares a millionth of its length wide keeps its faces.
    x, y = np.meshgrid(np.arange(5.0), np.array([0.0, 1e-6]), indexing="ij")
    mesh = Mesh(np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1), grid_faces(5, 2))
    assert MapState(mesh, Parameterization(mesh.vertices[:, :2], mesh.faces)).welded == 0


def test_places_are_exact_and_a_negative_zero_is_a_zero():
    points = np.array([[0.0, 1.0], [-0.0, 1.0], [1e-300, 1.0], [0.0, 1.0]])
    place = places(points)
    assert place[0] == place[1] == place[3] != place[2]
