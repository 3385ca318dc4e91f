"""Distortion against closed forms and hand computation: planar maps, developables, sphere maps."""

import igl
import numpy as np
import pytest
from numpy.testing import assert_allclose

from benchmarks.cases import builtin, models
from benchmarks.metrics import distortion
from benchmarks.metrics.distortion import face_distortion, triangles
from benchmarks.metrics.evaluation import evaluate
from benchmarks.metrics.state import MapState
from benchmarks.metrics.table import METRICS
from parapoint import Mesh, Parameterization

DISTORTIONS = [m for m in METRICS.values() if m.group in ("conformal", "authalic", "isometric")]
EXACT = 1e-12


def in_plane(points, faces):
    return Mesh(np.column_stack([points, np.zeros(len(points))]), faces)


def unit_square(n=5):
    x, y = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n))
    return np.stack([x.ravel(), y.ravel()], 1), builtin.grid_faces(n, n)


def developed(mesh):
    """(V, 2) the mesh unfolded face by face from the first: exact where an isometry exists."""
    uv = np.full((len(mesh.vertices), 2), np.nan)
    v = mesh.vertices
    around = {}
    for face, edges in enumerate(mesh.edge_of_halfedge.reshape(-1, 3)):
        for edge in edges:
            around.setdefault(edge, []).append(face)
    a, b, _ = mesh.faces[0]
    uv[a], uv[b] = (0, 0), (np.linalg.norm(v[b] - v[a]), 0)
    queue, seen = [0], {0}
    for face in queue:
        corners = mesh.faces[face]
        for k in range(3):
            i, j, l = np.roll(corners, -k)
            if np.isnan(uv[l]).any():
                side = v[j] - v[i]
                length = np.linalg.norm(side)
                along = (v[l] - v[i]) @ side / length
                height = np.linalg.norm(np.cross(side, v[l] - v[i])) / length
                axis = (uv[j] - uv[i]) / np.linalg.norm(uv[j] - uv[i])
                uv[l] = uv[i] + along * axis + height * np.array([-axis[1], axis[0]])
        for edge in mesh.edge_of_halfedge.reshape(-1, 3)[face]:
            for other in around[edge]:
                if other not in seen:
                    seen.add(other)
                    queue.append(other)
    return uv


def order(errors):
    """Order of convergence when the edges are halved from one error to the next."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_similarity_has_every_distortion_at_its_ideal(mirrored):
    points, faces = unit_square()
    turn = np.array([[np.cos(0.6), -np.sin(0.6)], [np.sin(0.6), np.cos(0.6)]])
    uv = 7.3 * points @ turn + [3, -2]
    if mirrored:
        uv[:, 0] *= -1
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    for metric in DISTORTIONS:
        assert_allclose(values[metric.name], metric.ideal, atol=EXACT, err_msg=metric.name)


@pytest.mark.parametrize("k", [1.5, 4.0, 1e3])
def test_a_square_stretched_by_k_in_u(k):
    points, faces = unit_square()
    values = evaluate(in_plane(points, faces), Parameterization(points * [k, 1], faces))
    # Areas all grow by k, so J is diag(k, 1) / sqrt(k). In each right triangle with legs 1 the
    # angles pi/2, pi/4, pi/4 become pi/2, atan(k), atan(1/k).
    bend = np.arctan(k) - np.pi / 4
    expected = {
        "angle_difference_mean": 2 / 3 * bend,
        "angle_difference_area_weighted": 2 / 3 * bend,
        "angle_difference_p95": bend,
        "angle_difference_max": bend,
        "angle_discrepancy_total": 2 * bend,
        "angle_distortion_max": k + 1 / k - 2,
        "quasi_conformal_mean": k,
        "quasi_conformal_p95": k,
        "quasi_conformal_max": k,
        "area_discrepancy_total": 0,
        "area_distortion_max": 0,
        "area_log_ratio_mean": 0,
        "area_ratio_clipped_mean": 1,
        "symmetric_dirichlet": 2 * (k + 1 / k),
        "stretch_l2": np.sqrt((k + 1 / k) / 2),
        "stretch_linf": np.sqrt(k),
        "isometric_distortion_mean": np.sqrt(k),
        "isometric_distortion_max": np.sqrt(k),
        "singular_value_min": 1 / np.sqrt(k),
        "singular_value_max": np.sqrt(k),
    }
    assert set(expected) == {m.name for m in DISTORTIONS if "_without" not in m.name}
    for name, value in expected.items():
        assert_allclose(values[name], value, rtol=1e-9, atol=EXACT, err_msg=name)


def test_two_triangles_by_hand():
    # Two triangles of area 1/2; the second is drawn twice as large: a/A = 2/5 and 8/5.
    points = np.array([[0, 0], [1, 0], [0, 1], [3, 0], [4, 0], [3, 1.0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    uv = np.concatenate([points[:3], 2 * points[3:]])
    found = face_distortion(triangles(in_plane(points, faces), Parameterization(uv, faces)))
    assert_allclose(found.area, [0.5, 0.5], rtol=EXACT)
    assert_allclose(found.uv_area, [0.2, 0.8], rtol=EXACT)
    assert_allclose(found.sigma1, np.sqrt([0.4, 1.6]), rtol=EXACT)
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    assert_allclose(values["area_discrepancy_total"], 0.6, rtol=EXACT)
    assert_allclose(values["area_distortion_max"], 0.4 + 2.5 - 2, rtol=EXACT)
    assert_allclose(values["area_log_ratio_mean"], (np.log(2.5) + np.log(1.6)) / 2, rtol=EXACT)
    assert_allclose(values["area_ratio_clipped_mean"], (2.5 + 1.6) / 2, rtol=EXACT)
    assert_allclose(values["quasi_conformal_max"], 1, rtol=EXACT)
    assert_allclose(values["stretch_l2"], np.sqrt((2.5 + 0.625) / 2), rtol=EXACT)
    assert_allclose(values["symmetric_dirichlet"], 0.4 + 2.5 + 1.6 + 0.625, rtol=EXACT)


def test_large_faces_count_for_more():
    # A triangle of area 12.5 keeps its shape; one of area 0.5, 1/26 of all, is stretched to 4.
    points = np.array([[0, 0], [5, 0], [0, 5], [7, 0], [8, 0], [7, 1.0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    uv = np.concatenate([points[:3], points[3:] * [4, 1]])
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    # With both areas scaled to 1, sigma^2 of the large triangle is 13 / 14.5 = 26 / 29.
    square = 26 / 29
    large = 2 * (square + 1 / square)
    small = (16 + 1) * square + (1 / 16 + 1) / square
    assert_allclose(values["symmetric_dirichlet"], (25 * large + small) / 26, rtol=EXACT)
    assert_allclose(values["quasi_conformal_mean"], (25 + 4) / 26, rtol=EXACT)
    assert_allclose(values["quasi_conformal_p95"], 1, rtol=EXACT)  # 25/26 of the area: 96 %
    assert_allclose(values["quasi_conformal_max"], 4, rtol=EXACT)


def test_the_area_ratio_is_clipped_at_ten():
    points = np.array([[0, 0], [1, 0], [0, 1], [3, 0], [4, 0], [3, 1.0]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    uv = np.concatenate([points[:3], 100 * points[3:]])
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    # a/A = 2 / 10001 and 20000 / 10001.
    assert_allclose(values["area_ratio_clipped_mean"], (10 + 20000 / 10001) / 2, rtol=EXACT)


def test_singular_values_agree_with_a_decomposition():
    rng = np.random.default_rng(3)
    vertices, uv = rng.normal(size=(300, 3)), rng.normal(size=(300, 2))
    # A wide range of anisotropy: sigma2 must keep its digits where it is far below sigma1.
    uv[:150] *= [1, 1e-7]
    faces = np.arange(300).reshape(-1, 3)
    found = triangles(Mesh(vertices, faces), Parameterization(uv, faces))
    for face, (a, b, c) in enumerate(faces):
        sides = np.stack([vertices[b] - vertices[a], vertices[c] - vertices[a]], 1)
        frame, local = np.linalg.qr(sides)
        assert frame.shape == (3, 2)
        jacobian = np.stack([uv[b] - uv[a], uv[c] - uv[a]], 1) @ np.linalg.inv(local)
        expected = np.linalg.svd(jacobian, compute_uv=False)
        assert_allclose(found.sigma1[face], expected[0], rtol=1e-11)
        assert_allclose(found.sigma2[face], expected[1], rtol=1e-8)  # the decomposition's own error
    assert_allclose(found.sigma1 * found.sigma2, np.abs(found.uv_area) / found.area, rtol=1e-11)
    assert_allclose(found.area, igl.doublearea(vertices, faces) / 2, rtol=1e-9)


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e150])
def test_angles_sum_to_pi_at_any_scale(scale):
    rng = np.random.default_rng(4)
    faces = np.arange(60).reshape(-1, 3)
    found = triangles(
        Mesh(scale * rng.normal(size=(60, 3)), faces),
        Parameterization(scale * rng.normal(size=(60, 2)), faces),
    )
    assert_allclose(found.angle.sum(axis=1), np.pi, rtol=EXACT)
    assert_allclose(found.uv_angle.sum(axis=1), np.pi, rtol=EXACT)
    assert not found.degenerate_3d.any()


def assert_isometry(mesh, uv):
    found = MapState(mesh, Parameterization(uv, mesh.faces)).distortion
    assert_allclose(found.sigma1, 1, rtol=1e-9)
    assert_allclose(found.sigma2, 1, rtol=1e-9)
    assert found.angle_difference.max() < 1e-9


def test_the_half_cylinder_unrolls_by_its_chords():
    mesh = builtin.half_cylinder(12)
    chord = 2 * np.sin(np.pi / 24)
    facet = np.round(np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]) / (np.pi / 12))
    assert_isometry(mesh, np.stack([chord * facet, mesh.vertices[:, 2]], 1))


def test_a_rolled_plate_unrolls():
    turns, width = np.linspace(0, 4 * np.pi, 41), np.linspace(0, 1, 6)
    spiral = np.stack([(1 + 0.1 * turns) * np.cos(turns), (1 + 0.1 * turns) * np.sin(turns)], 1)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(spiral, axis=0), axis=1))])
    vertices = np.array([[x, y, z] for x, y in spiral for z in width])
    uv = np.array([[s, z] for s in length for z in width])
    assert_isometry(Mesh(vertices, builtin.grid_faces(41, 6)), uv)


def real(name):
    try:
        return models.load(name)
    except models.MissingModelError as error:
        pytest.skip(str(error))


def test_the_rolled_plate_model_maps_to_the_flat_one():
    flat, rolled = real("plate4SD"), real("plate4SD_rolledA")
    assert (flat.faces == rolled.faces).all()
    thin = np.argmin(np.ptp(flat.vertices, axis=0))
    found = MapState(
        rolled, Parameterization(np.delete(flat.vertices, thin, axis=1), flat.faces)
    ).distortion
    # Rolled onto a smooth cylinder: the chords around it are shorter than the plate by 0.16 %,
    # the same everywhere, which after normalization is half of that each way.
    assert_allclose(found.sigma1, 1.0008, atol=1e-5)
    assert_allclose(found.sigma2, 0.9992, atol=1e-5)
    unrolled = MapState(rolled, Parameterization(developed(rolled), rolled.faces)).distortion
    assert_allclose(unrolled.sigma1, 1, atol=2e-5)  # coordinates in single precision
    assert_allclose(unrolled.sigma2, 1, atol=2e-5)


def test_the_slit_cylinder_model_unfolds():
    mesh = real("hilbert_slit_cylinder")
    found = MapState(mesh, Parameterization(developed(mesh), mesh.faces)).distortion
    # Six digits in the file leave angle defects of up to 4e-6, which add up along the way.
    assert_allclose(found.sigma1, 1, atol=2e-4)
    assert_allclose(found.sigma2, 1, atol=2e-4)


def cap_map(rings, radius_of):
    """A spherical cap of 60 degrees, its map with the given radius, the polar angle of faces."""
    mesh = builtin.sphere_cap(60, rings)
    polar = np.arccos(np.clip(mesh.vertices[:, 2], -1, 1))
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    uv = radius_of(polar)[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1)
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    at = np.arccos(middle[:, 2] / np.linalg.norm(middle, axis=1))
    return MapState(mesh, Parameterization(uv, mesh.faces)), at


RINGS = (8, 16, 32)


def test_the_stereographic_cap_face_by_face():
    # Stereographic projection is an inversion: it multiplies the length of the chord between two
    # points by the roots of their magnifications. So the sides of each image are known exactly,
    # and by the law of cosines its angles.
    mesh = builtin.sphere_cap(60, 8)
    state, _ = cap_map(8, lambda t: 2 * np.tan(t / 2))
    root = np.sqrt(2 / (1 + mesh.vertices[:, 2]))  # of 1/cos^2(t/2), at each vertex

    def angles(lengths):
        a, b, c = (lengths[:, k] for k in range(3))
        return np.stack(
            [
                np.arccos((y**2 + z**2 - x**2) / (2 * y * z))
                for x, y, z in ((a, b, c), (b, c, a), (c, a, b))
            ],
            axis=1,
        )

    ends = [(1, 2), (2, 0), (0, 1)]
    corner = mesh.vertices[mesh.faces]
    chords = np.stack([np.linalg.norm(corner[:, i] - corner[:, j], axis=1) for i, j in ends], 1)
    roots = np.stack([root[mesh.faces[:, i]] * root[mesh.faces[:, j]] for i, j in ends], 1)
    expected = np.abs(angles(chords) - angles(chords * roots))
    assert_allclose(state.distortion.angle_difference, expected, atol=1e-9)
    assert_allclose(distortion.angle_difference_mean(state.distortion), expected.mean(), rtol=1e-9)


def test_the_stereographic_cap_is_conformal_in_the_limit():
    # By the same identity the sides of a face of size h grow unequally by a share of order h, so
    # sigma1/sigma2 is 1 + O(h), and sigma1/sigma2 + sigma2/sigma1 - 2 is O(h^2).
    excess, squared, area_error = [], [], []
    for rings in RINGS:
        state, polar = cap_map(rings, lambda t: 2 * np.tan(t / 2))
        found = state.distortion
        ratio = found.quasi_conformal
        excess.append(distortion.quasi_conformal_mean(found) - 1)
        squared.append(np.average(ratio + 1 / ratio - 2, weights=found.area))
        # Magnification 1/cos^4(t/2); the whole cap, of half angle T = 60 degrees, 1/cos^2(T/2).
        expected = np.cos(np.pi / 6) ** 2 / np.cos(polar / 2) ** 4
        area_error.append(np.average(np.abs(found.area_ratio / expected - 1), weights=found.area))
    assert (order(excess) > 0.95).all()
    assert (order(squared) > 1.95).all()
    assert (order(area_error) > 0.95).all()
    assert squared[-1] < 1e-4
    assert area_error[-1] < 2e-3


def test_the_equal_area_cap_keeps_areas_in_the_limit():
    area, squared, ratio = [], [], []
    for rings in RINGS:
        state, polar = cap_map(rings, lambda t: 2 * np.sin(t / 2))
        found = state.distortion
        area.append(distortion.area_log_ratio_mean(found))
        squared.append(np.average(found.area_log_ratio**2, weights=found.area))
        expected = 1 / np.cos(polar / 2) ** 2
        ratio.append(np.average(np.abs(found.quasi_conformal / expected - 1), weights=found.area))
    assert (order(area) > 0.95).all()
    assert (order(squared) > 1.9).all()
    assert squared[-1] < 1e-5
    assert (order(ratio) > 0.9).all()  # a gradient of an interpolant is of first order
    assert ratio[-1] < 2e-2


def test_the_equirectangular_sphere_stretches_by_the_secant():
    errors = []
    for n in (12, 24, 48):
        longitude, latitude = np.linspace(0, 1.5, n + 1), np.linspace(-1.2, 1.2, n + 1)
        u, v = (a.ravel() for a in np.meshgrid(longitude, latitude))
        points = np.stack([np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v)], 1)
        faces = builtin.grid_faces(n + 1, n + 1)
        found = triangles(Mesh(points, faces), Parameterization(np.stack([u, v], 1), faces))
        secant = 1 / np.cos(v[faces].mean(axis=1))
        # Before normalization.
        error = np.abs(found.sigma1 / secant - 1) + np.abs(found.sigma2 - 1)
        errors.append(np.average(error, weights=found.area))
    assert (order(errors) > 0.9).all()
    assert errors[-1] < 2e-2


def test_percentiles_by_hand():
    assert distortion.percentile(np.array([3.0, 1.0, 2.0]), 95) == 3
    assert distortion.percentile(np.arange(1.0, 101.0), 95) == 95
    # The values up to 2 carry exactly 95 % of the weight.
    weights = np.array([0.9, 0.05, 0.05])
    assert distortion.percentile(np.array([1.0, 2.0, 3.0]), 95, weights) == 2
    assert distortion.percentile(np.array([1.0, 2.0, np.inf]), 96, weights) == np.inf
    assert distortion.percentile(np.array([]), 95) == np.inf


BEND = np.pi / 4 - np.arctan(0.5)
"""By how much the two acute angles of half a square change if the square is stretched to 2 x 1."""


@pytest.mark.parametrize(
    ("metric", "squares", "stretched", "value"),
    [
        ("quasi_conformal_p95", 20, 1, 1),  # exactly 95 % of the area keep their shape
        ("quasi_conformal_p95", 19, 1, 2),
        ("angle_difference_p95", 40, 3, 0),  # two corners of three change: 5 % of all
        ("angle_difference_p95", 39, 3, BEND),
    ],
)
def test_a_twentieth_may_be_worse_than_the_95th_percentile(
    metric: str, squares: int, stretched: int, value: float
) -> None:
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1.0]])
    corners = np.array([[0, 1, 2], [0, 2, 3]])
    at = np.arange(squares)
    faces = (corners + 4 * at[:, None, None]).reshape(-1, 3)
    factor = np.where(at < stretched, 2.0, 1.0)[:, None, None] * [1, 0] + [0, 1]
    points = (square + 3.0 * at[:, None, None] * [1, 0]).reshape(-1, 2)
    uv = (square * factor + 3.0 * at[:, None, None] * [1, 0]).reshape(-1, 2)
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    assert_allclose(values[metric], value, atol=EXACT)


def test_a_face_degenerate_in_uv_is_infinite_counted_and_left_out_of_means():
    points = np.array([[0, 0], [1, 0], [0, 1], [1, 1.0], [2, 0], [2, 1]])
    faces = np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3], [4, 5, 3]])
    uv = points.copy()
    uv[5] = [2, 0.5]
    uv[4] = [2, 0]
    uv[3] = [1, 1]
    uv[5] = (uv[4] + uv[3]) / 2  # the last face collapses to a line
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    assert values["degenerate_uv_count"] == 1
    assert values["degenerate_3d_count"] == 0
    for name in ("quasi_conformal_max", "isometric_distortion_max", "area_distortion_max"):
        assert values[name] == np.inf
    assert values["stretch_linf"] == np.inf
    assert values["singular_value_min"] == 0
    assert values["quasi_conformal_p95"] == np.inf
    assert_allclose(values["quasi_conformal_mean"], 1, rtol=EXACT)
    assert_allclose(values["angle_difference_max"], 0, atol=EXACT)
    # Three faces hold 1/3 of the UV area but 1/4 of the surface each; the last holds none.
    assert_allclose(values["area_discrepancy_total"], 3 / 12 + 1 / 4, rtol=EXACT)
    assert_allclose(values["area_log_ratio_mean"], np.log(4 / 3), rtol=EXACT)
    assert_allclose(values["area_ratio_clipped_mean"], (3 * 4 / 3 + 10) / 4, rtol=EXACT)


def test_a_face_degenerate_in_3d_takes_no_part():
    points = np.array([[0, 0], [1, 0], [0, 1], [2, 0.0]])
    # The last face is a line in 3D, whatever area it has in UV.
    faces = np.array([[0, 1, 2], [0, 1, 3]])
    uv = np.array([[0, 0], [1, 0], [0, 1], [0, -50.0]])
    values = evaluate(in_plane(points, faces), Parameterization(uv, faces))
    assert values["degenerate_3d_count"] == 1
    assert values["degenerate_uv_count"] == 0
    for metric in DISTORTIONS:
        assert_allclose(values[metric.name], metric.ideal, atol=EXACT, err_msg=metric.name)


def test_slivers_and_tiny_triangles_are_not_degenerate():
    points = np.array([[0, 0], [1, 0], [0.5, 1e-9], [1e-8, 0], [0, 1e-8]])
    faces = np.array([[0, 1, 2], [0, 3, 4]])
    found = triangles(in_plane(points, faces), Parameterization(points, faces))
    assert not found.degenerate_3d.any()
    assert not found.degenerate_uv.any()
    assert_allclose(found.sigma2, 1, rtol=1e-6)  # of a sliver, 1e-9 of whose digits are noise


def test_the_distortion_of_some_faces_is_that_of_these_alone() -> None:
    # The second triangle is drawn three times as large: alone it is an isometry.
    points = np.array([[0, 0], [1, 0], [0, 1], [3, 0], [4, 0], [3, 1], [9, 9], [9, 9], [9, 9.0]])
    faces = np.arange(9).reshape(3, 3)  # the last has no area and never counts
    uv = np.concatenate([points[:3], 3 * points[3:6], points[:3] + 20])
    of = triangles(in_plane(points, faces), Parameterization(uv, faces))
    some = face_distortion(of, np.array([False, True, True]))
    assert some.faces.tolist() == [1]
    assert_allclose([some.area[0], some.sigma1[0], some.sigma2[0]], 1, rtol=EXACT)
    assert face_distortion(of).faces.tolist() == [0, 1]
