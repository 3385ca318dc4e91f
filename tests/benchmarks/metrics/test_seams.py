"""Seams, charts, packing by hand; spanning faces where it is known which they are."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from baselines import registry
from benchmarks.cases import builtin, models
from benchmarks.metrics import seams
from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.state import MapState
from parapoint import Mesh, Parameterization

EXACT = 1e-12


def spanning(mesh, parameterization):
    return MapState(mesh, parameterization).spanning


CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
SIDES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]


def cube():
    """A cube of two triangles a side, each side a chart of its own, the six in a row."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    faces, corners, uv = [], [], []
    for k, side in enumerate(SIDES):
        for triangle in ([0, 1, 2], [0, 2, 3]):
            faces.append([side[i] for i in triangle])
            corners.append([4 * k + i for i in triangle])
        uv.append(square + np.array([1.5 * k, 0]))
    return Mesh(CUBE, faces), Parameterization(np.concatenate(uv), np.array(corners))


def test_a_cube_cut_into_its_sides():
    values = evaluate(*cube())
    assert values["chart_count"] == 6
    assert_allclose(values["seam_length"], 12 / np.sqrt(6), rtol=EXACT)  # each edge once
    assert_allclose(values["uv_boundary_length"], 24 / np.sqrt(6), rtol=EXACT)
    assert_allclose(values["packing_efficiency"], 6 / 8.5**2, rtol=EXACT)
    assert_allclose(values["resolution"], 8.5, rtol=EXACT)  # a side of 1 is 1/8.5 of the texture
    assert values["quasi_conformal_max"] == pytest.approx(1, abs=EXACT)
    assert values["bijective"] == 1
    assert values["spanning_fraction"] == 0


def test_an_original_boundary_is_no_seam():
    mesh = builtin.half_cylinder(8)
    uv = np.stack([np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]), mesh.vertices[:, 2]], 1)
    values = evaluate(mesh, Parameterization(uv, mesh.faces))
    assert values["seam_length"] == 0
    assert_allclose(values["uv_boundary_length"], (2 * np.pi + 6) / np.sqrt(3 * np.pi), rtol=EXACT)
    assert_allclose(values["packing_efficiency"], 3 / np.pi, rtol=EXACT)


def test_resolution_grows_with_the_surface():
    mesh, parameterization = cube()
    values = evaluate(Mesh(10 * mesh.vertices, mesh.faces), parameterization)
    assert_allclose(values["resolution"], 85, rtol=EXACT)
    assert_allclose(values["seam_length"], 12 / np.sqrt(6), rtol=EXACT)


def test_the_seam_of_an_open_cylinder_is_its_height():
    around, height = 12, 2.0
    angle = 2 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(angle), np.sin(angle)], 1)
    vertices = np.concatenate([np.column_stack([ring, np.full(around, z)]) for z in (0.0, height)])
    grid = builtin.grid_faces(2, around + 1)
    faces = (grid % (around + 1)) % around + around * (grid // (around + 1))
    uv = np.array([[u, z] for z in (0, height) for u in np.arange(around + 1) * np.pi / 6])
    mesh, parameterization = Mesh(vertices, faces), Parameterization(uv, grid)
    chord = 2 * np.sin(np.pi / around)
    values = evaluate(mesh, parameterization)
    assert_allclose(values["seam_length"], height / np.sqrt(around * chord * height), rtol=EXACT)
    # One uv a vertex instead: no seam, but the last column of faces spans it.
    one = np.array([[u, z] for z in (0, height) for u in np.arange(around) * np.pi / 6])
    assert (
        spanning(mesh, Parameterization(one, faces)) == (np.ptp(faces % around, axis=1) > 1)
    ).all()


def wrapped(points, faces, cut):
    """Longitude and latitude of points, the longitude wrapping where `cut` says; which span."""
    longitude = np.arctan2(points[:, 1], points[:, 0])
    longitude = np.where(longitude > cut, longitude - 2 * np.pi, longitude)
    uv = np.stack([longitude, np.arcsin(np.clip(points[:, 2], -1, 1))], 1)
    return uv, np.ptp(longitude[faces], axis=1) > np.pi


@pytest.mark.parametrize("subdivisions", [2, 3, 4])
@pytest.mark.parametrize("scale", [(1.0, 1.0), (1e-6, 1e4)])
def test_faces_across_the_date_line_span(subdivisions, scale):
    rng = np.random.default_rng(subdivisions)
    mesh = builtin.sphere(subdivisions)
    points = mesh.vertices @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    uv, truth = wrapped(points, mesh.faces, 2.8)
    # Around the poles longitude tears as well; what spans there is a matter of taste.
    kept = (np.abs(points[mesh.faces][:, :, 2]) < 0.95).all(axis=1)
    found = spanning(
        Mesh(scale[0] * points, mesh.faces[kept]), Parameterization(scale[1] * uv, mesh.faces[kept])
    )
    assert truth[kept].sum() > 10
    assert (found == truth[kept]).all()


def test_a_ragged_cut_is_found():
    # The cut wanders by an edge length from vertex to vertex: some have sound faces on few sides.
    rng = np.random.default_rng(1)
    mesh = builtin.sphere(4)
    edge = np.sqrt(4 * np.pi / len(mesh.faces))
    uv, truth = wrapped(
        mesh.vertices, mesh.faces, 2.8 + rng.uniform(-edge, edge, len(mesh.vertices))
    )
    kept = (np.abs(mesh.vertices[mesh.faces][:, :, 2]) < 0.95).all(axis=1)
    found = spanning(Mesh(mesh.vertices, mesh.faces[kept]), Parameterization(uv, mesh.faces[kept]))
    missed = (truth[kept] & ~found).sum()
    assert missed <= 0.02 * truth[kept].sum()
    assert not (found & ~truth[kept]).any()


def test_spanning_faces_are_left_out_and_counted():
    mesh = builtin.sphere(4)
    uv, truth = wrapped(mesh.vertices, mesh.faces, 2.8)
    values = evaluate(mesh, Parameterization(uv, mesh.faces))
    assert_allclose(values["spanning_fraction"], truth.mean(), rtol=0.1)
    # The faces that bridge the date line are spread over 2 pi: most of the UV area.
    state = MapState(mesh, Parameterization(uv, mesh.faces))
    kept = state.distortion_without_spanning
    assert len(kept.faces) == len(mesh.faces) - state.spanning.sum()
    assert_allclose(kept.area.sum(), 1, rtol=EXACT)
    assert_allclose(kept.uv_area.sum(), 1, rtol=EXACT)
    for name in ("area_discrepancy_total", "angle_difference_mean", "symmetric_dirichlet"):
        assert values[name + "_without_spanning"] < values[name]
    # The rest is one to one.
    for name in ("flipped_fraction", "flipped_uv_area_fraction", "overlap_area"):
        assert values[name] > 0
        assert values[name + "_without_spanning"] == 0


@pytest.mark.parametrize("name", ["camelhead", "hand_1_i_f5000"])
@pytest.mark.parametrize("method", ["lscm", "slim(energy=symmetric_dirichlet, iterations=2)"])
def test_no_face_of_a_map_of_a_disk_spans(name, method):
    try:
        mesh = models.load(name)
    except models.MissingModelError as error:
        pytest.skip(str(error))
    parameterization = registry.method(method)[1].parameterize(mesh, seed=0)
    assert not spanning(mesh, parameterization).any()


def test_a_web_across_the_gap_of_a_cut_is_part_of_the_map():
    # A strip of squares, one of which is drawn ten times as long: stretched, but over nothing.
    x, y = np.meshgrid(np.arange(9.0), np.arange(2.0), indexing="ij")
    points, faces = np.stack([x.ravel(), y.ravel()], 1), builtin.grid_faces(9, 2)
    mesh = Mesh(np.column_stack([points, 0 * points[:, 0]]), faces)
    torn = Parameterization(points + np.where(points > [4, 9], 9, 0), faces)
    assert seams.spanning_edges(mesh, torn).any()
    assert not spanning(mesh, torn).any()
    # Turned back over the strip it does span.
    back = Parameterization(np.where(points > [4, 9], points - [10, 0], points), faces)
    assert spanning(mesh, back).sum() == 2


def test_a_coarse_mesh_has_no_spanning_face_by_its_long_edges_alone():
    mesh, parameterization = cube()
    assert not spanning(mesh, parameterization).any()


def test_one_calm_bank_is_enough():
    # A strip of squares; from column 5 on all is drawn 40 times as large, 100 away. The edges in
    # between are stretched by 100: more than 5 times what is usual on the left (1), but less than
    # 5 times what is usual on the right (40).
    x, y = np.meshgrid(np.arange(9.0), np.arange(2.0), indexing="ij")
    points, faces = np.stack([x.ravel(), y.ravel()], 1), builtin.grid_faces(9, 2)
    right = points[:, :1] > 4
    uv = np.where(right, [104, 0] + 40 * (points - [5, 0]), points)
    mesh = Mesh(np.column_stack([points, 0 * points[:, 0]]), faces)
    given = Parameterization(uv, faces)
    between = right[given.edges, 0].sum(axis=1) == 1
    assert between.sum() == 3
    assert (seams.spanning_edges(mesh, given) == between).all()


def test_edges_without_length_do_not_span():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.0]])
    mesh = Mesh(vertices, [[0, 1, 2], [0, 3, 1]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [50, -50.0]])
    assert not seams.spanning_edges(mesh, Parameterization(uv, mesh.faces))[
        (Parameterization(uv, mesh.faces).edges == [0, 3]).all(axis=1)
    ].any()
