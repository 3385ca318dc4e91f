"""Domains of the methods for disks, and what is measured on their triangles, by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.planar.domains import (
    Domain,
    FlatteningError,
    arc_lengths,
    check_iterations,
    check_triangles,
    circle,
    closed_holes,
    domain,
    far_pair,
    finite,
    frames,
    is_kept,
    scaled,
    singular_values,
)
from parapoint.planar.energies import DENSITIES, stepper
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import Mesh, PointCloud

SQUARE = np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [0, 2, 0]])


def frame_of_a_picture() -> Mesh:
    """A square of side 3 with a square hole of side 1 in its middle, sixteen vertices."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(4.0), np.arange(4.0)))
    corner = np.array([4 * j + i for j in range(3) for i in range(3) if (i, j) != (1, 1)])
    faces = [corner[:, None] + side for side in ([0, 1, 5], [0, 5, 4])]
    return Mesh(np.column_stack([x, y, 0 * x]), np.concatenate(faces))


def test_a_domain_has_no_vertex_without_a_face_and_keeps_the_order_of_the_others():
    littered = np.insert(SQUARE, [0, 2, 4], 9.0, axis=0)  # rows 0, 3 and 6 belong to no face
    found = domain(Mesh(littered, [[1, 2, 4], [1, 4, 5]]))
    assert_array_equal(found.vertices, SQUARE)
    assert_array_equal(found.faces, [[0, 1, 2], [0, 2, 3]])
    assert found.area == 6.0
    assert sorted(found.loop) == [0, 1, 2, 3]


@pytest.mark.parametrize("faces", [[[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]])
@pytest.mark.parametrize("turn", range(3))
def test_the_loop_of_a_domain_runs_along_the_edges_of_its_faces(faces, turn):
    found = domain(Mesh(SQUARE, np.roll(faces, turn, axis=1)))
    edges = {(a, b) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    steps = set(zip(found.loop, np.roll(found.loop, -1), strict=True))
    assert len(steps) == 4
    assert steps <= edges


def test_what_is_no_disk_is_refused():
    with pytest.raises(UnsupportedError, match="point cloud"):
        domain(PointCloud(SQUARE))
    tetrahedron = Mesh(
        np.eye(4, 3),
        [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]],
    )
    with pytest.raises(UnsupportedError, match="needs a disk"):
        domain(tetrahedron)


def test_each_hole_is_closed_by_a_fan_around_its_mean():
    mesh = frame_of_a_picture()
    disk = domain(mesh)
    vertices, faces = closed_holes(disk)
    assert_array_equal(vertices[:16], disk.vertices)
    assert_allclose(vertices[16:], [[1.5, 1.5, 0]])
    assert_array_equal(faces[:16], disk.faces)
    whole = Mesh(vertices, faces)
    assert len(whole.faces) == 20
    assert len(whole.boundary_loops) == 1
    # The fan's triangles turn as those of the domain, and fill the hole.
    assert_allclose(signed_areas(vertices[:, :2], faces[16:]), 0.25)
    assert whole.is_planar_domain


def test_two_holes_are_closed_each_around_its_own_mean():
    x, y = (of.ravel() for of in np.meshgrid(np.arange(6.0), np.arange(4.0)))
    holes = {(1, 1), (3, 1)}
    corner = np.array([6 * j + i for j in range(3) for i in range(5) if (i, j) not in holes])
    faces = np.concatenate([corner[:, None] + side for side in ([0, 1, 7], [0, 7, 6])])
    vertices, closed = closed_holes(domain(Mesh(np.column_stack([x, y, 0 * x]), faces)))
    centres = vertices[len(x) :]
    assert_allclose(centres[np.argsort(centres[:, 0])], [[1.5, 1.5, 0], [3.5, 1.5, 0]])
    assert_allclose(signed_areas(vertices[:, :2], closed).sum(), 15)
    assert len(Mesh(vertices, closed).boundary_loops) == 1


def test_a_triangle_without_area_is_named():
    check_triangles(SQUARE, np.array([[0, 1, 2]]))
    with pytest.raises(InputError, match=r"face 1 has no area \(one of 2 such"):
        check_triangles(SQUARE, np.array([[0, 1, 2], [0, 1, 1], [2, 2, 2]]))


def test_a_closed_polygon_on_the_circle_is_spaced_as_its_sides_are_long():
    triangle = np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]])  # sides 3, 4 and 5
    assert_allclose(arc_lengths(triangle), [3, 4, 5])
    angle = 2 * np.pi * np.array([0, 3, 7]) / 12
    assert_allclose(circle(triangle), np.stack([np.cos(angle), np.sin(angle)], 1), atol=1e-15)


def test_far_points_are_the_first_of_those_equally_far():
    # All corners of a rectangle are equally far from its mean; corner 2 is opposite corner 0.
    assert far_pair(SQUARE) == (0, 2)
    # Up to rounding the second and the third are equally far from the mean, and so the first wins.
    line = np.array([[0.0, 0, 0], [-1, 0, 0], [1 + 1e-10, 0, 0], [-1e-10, 0, 0]])
    assert far_pair(line) == (1, 2)
    # Beyond rounding it does not.
    line = np.array([[0.0, 0, 0], [-1, 0, 0], [1 + 1e-5, 0, 0], [-1e-5, 0, 0]])
    assert far_pair(line) == (2, 1)


def test_only_finite_maps_with_area_pass():
    disk = Domain(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]), np.arange(4), 6.0)
    uv = SQUARE[:, :2]
    assert finite(uv) is uv
    assert_allclose(scaled(disk, 5 * uv), uv)
    assert_allclose(scaled(disk, 0.5 * uv[:, ::-1]), uv[:, ::-1])  # turned over, and its area kept
    with pytest.raises(FlatteningError, match="not finite"):
        finite(uv * [np.nan, 1])
    with pytest.raises(FlatteningError, match="not finite"):
        scaled(disk, np.where(uv > 2, np.inf, uv))
    with pytest.raises(FlatteningError, match="collapsed"):
        scaled(disk, uv * [1, 0])


@pytest.mark.parametrize(("stretch", "wanted"), [
    ([[3, 0], [0, 2]], (3, 2)),
    ([[0, 2], [3, 0]], (3, -2)),  # a reflection
    ([[1, 1], [0, 1]], ((np.sqrt(5) + 1) / 2, (np.sqrt(5) - 1) / 2)),  # a shear: the golden ratio
    ([[0.6, -0.8], [0.8, 0.6]], (1, 1)),  # a turn
])  # fmt: skip
def test_singular_values_of_linear_maps(stretch, wanted):
    turned, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    flat = np.array([[0.0, 0], [2, 0.5], [0.3, 1.7]])
    disk = Domain(flat @ turned[:2], np.array([[0, 1, 2]]), np.arange(3), 1.0)
    values = singular_values(
        frames(disk.vertices, disk.faces), flat @ np.transpose(stretch), disk.faces
    )
    assert_allclose(np.ravel(values), wanted, atol=1e-12)


def test_a_trace_keeps_steps_that_begin_with_1_2_or_5_and_the_last():
    assert [k for k in range(1, 1001) if is_kept(k, 730)] == [
        1, 2, 5, 10, 20, 50, 100, 200, 500, 730, 1000
    ]  # fmt: skip


def test_iterations_begin_at_one():
    check_iterations(1)
    with pytest.raises(InputError, match="at least 1, not 0"):
        check_iterations(0)


@pytest.mark.parametrize(("name", "at"), [
    ("symmetric_dirichlet", 4 + 1 / 4 + 9 + 1 / 9),
    ("conformal", 13 / 12),
    ("log_arap", np.log(2) ** 2 + np.log(3) ** 2),
    ("exp_conformal", 13 / 12),
])  # fmt: skip
def test_energies_of_singular_values_two_and_three(name, at):
    density, least = DENSITIES[name]
    assert density(2.0, 3.0) == pytest.approx(at)
    assert density(1.0, 1.0) == pytest.approx(least)


def test_a_stretched_square_steps_back_towards_an_isometry_in_its_own_unit():
    for unit in (1e-3, 1.0, 1e3):
        disk = domain(Mesh(unit * SQUARE, [[0, 1, 2], [0, 2, 3]]))
        step = stepper(disk, unit * SQUARE[:, :2] * [2, 1], "symmetric_dirichlet")
        uv = step(20)
        assert uv.shape == (4, 2)
        sides = np.linalg.norm(np.roll(uv, -1, axis=0) - uv, axis=1)
        assert_allclose(sides, unit * np.array([3, 2, 3, 2]), rtol=1e-3)
