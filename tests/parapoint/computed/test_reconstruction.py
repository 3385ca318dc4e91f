import numpy as np
import pytest

from parapoint.computed import reconstruction
from parapoint.computed.reconstruction import (
    _filled,
    _Front,
    _single_fans,
    defects,
    roughness,
    triangulation,
)
from parapoint.surfaces.surface import Mesh


def sphere(count: int = 600) -> np.ndarray:
    """A Fibonacci lattice: even, and no four points on a circle."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.arange(count) * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - z**2)
    return np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def torus(rows: int = 40, columns: int = 16) -> np.ndarray:
    u, v = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    u, v = (u.ravel() + 0.5 * (v.ravel() % 2)) * 2 * np.pi / rows, v.ravel() * 2 * np.pi / columns
    r = 1 + 0.4 * np.cos(v)
    return np.column_stack([r * np.cos(u), r * np.sin(u), 0.4 * np.sin(v)])


def test_a_sphere_is_closed_and_of_its_area() -> None:
    mesh = triangulation(sphere())
    assert mesh.topology == "sphere"
    assert mesh.referenced.all()
    assert 0.97 * 4 * np.pi < mesh.face_areas.sum() < 4 * np.pi
    # Oriented: every triangle sees the centre from the same side.
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    sides = np.sign((np.cross(b - a, c - a) * a).sum(axis=1))
    assert abs(sides.sum()) == len(sides)


def test_a_torus_has_one_handle_and_a_grid_in_a_plane_is_a_disk() -> None:
    assert triangulation(torus()).topology == "genus 1 with no boundary"
    xy = np.stack(np.meshgrid(np.arange(12.0), np.arange(9.0)), axis=2).reshape(-1, 2)
    mesh = triangulation(np.pad(xy, ((0, 0), (0, 1))))
    assert mesh.topology == "disk"
    assert mesh.face_areas.sum() == pytest.approx(11 * 8)


def test_of_two_surfaces_the_larger_is_followed() -> None:
    mesh = triangulation(np.concatenate([sphere(300) + 9, sphere(600)]))
    assert np.array_equal(np.flatnonzero(mesh.referenced), np.arange(300, 900))


def test_a_sheet_near_another_is_kept_apart_by_its_inside() -> None:
    """A lens a third as thick as its points are apart: fronts alone grow 8 handles and holes."""
    mesh = triangulation(sphere() * [1, 1, 0.05])
    assert mesh.topology == "sphere"
    assert mesh.referenced.mean() > 0.98
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)[:, 2] / 2
    assert area[area > 0].sum() == pytest.approx(np.pi, rel=0.03)  # each sheet covers the lens once
    assert area[area < 0].sum() == pytest.approx(-np.pi, rel=0.03)


def test_an_oriented_front_takes_triangles_as_they_are() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    same, opposed = np.array([[0, 1, 2], [1, 3, 2]]), np.array([[0, 1, 2], [1, 2, 3]])
    for triangles, faces in ((same, 2), (opposed, 1)):
        front = _Front(points, triangles, np.array([0.7, 0.8]), 2.0, is_oriented=True)
        assert len(front.grown()) == faces
    assert len(_Front(points, opposed, np.array([0.7, 0.8]), 2.0).grown()) == 2


def test_the_largest_fan_stays_at_a_vertex() -> None:
    fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4]]
    other = [[0, 5, 6]]
    assert _single_fans(np.array(fan + other)).tolist() == fan


def test_a_hole_is_filled_in_the_faces_orientation() -> None:
    whole = triangulation(sphere(200))
    holed = whole.faces[~(whole.faces == 7).any(axis=1)]
    loops = Mesh(whole.vertices, holed).boundary_loops
    assert len(loops) == 1
    filled = Mesh(whole.vertices, _filled(whole.vertices, holed, loops))
    assert filled.topology == "sphere"


def test_a_front_goes_straight_on_unless_a_bend_is_much_smaller() -> None:
    # At one edge a triangle goes straight on, of radius 1, and one turns up by 90 degrees, whose
    # radius counts (1 + 2 (1 − 0)) times: at 0.8 as 2.4, at 0.3 as 0.9.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, -1, 0], [0.5, 1, 0], [0.5, 0, 1]])
    triangles = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    for radius, third in ((0.8, 3), (0.3, 4)):
        front = _Front(points, triangles, np.array([0.2, 1.0, radius]), 2.0)
        faces = front.grown()
        assert len(faces) == 2
        assert third in faces[1]


def test_defects_are_counted() -> None:
    # A strip of two triangles has four boundary edges; bent by 120 degrees it has a fold, too, and
    # a point that no triangle uses is another. A boundary edge is as rough as two quarter turns.
    for bend, folds in ((0.0, 0), (2 * np.pi / 3, 1)):
        up = [0.5, np.cos(bend), np.sin(bend)]
        points = [[0.0, 0, 0], [1, 0, 0], [0.5, -1, 0], up, [9, 9, 9]]
        mesh = Mesh(points, [[1, 0, 2], [0, 1, 3]])
        assert defects(mesh) == 4 + 1 + folds
        assert roughness(mesh) == pytest.approx(2 * 4 + 1 + bend / (np.pi / 2))
    # A handle counts 30, and a torus of fine rows has nothing else.
    assert defects(triangulation(torus())) == 30


def test_a_hole_is_closed_across_its_shorter_diagonal() -> None:
    # A rhombus with diagonals of 1 and 3 between four triangles.
    rhombus = [[0.5, 0, 0], [0, 1.5, 0], [-0.5, 0, 0], [0, -1.5, 0]]
    outer = [[2, 2, 0], [-2, 2, 0], [-2, -2, 0], [2, -2, 0]]
    around = np.array([[0, 4, 1], [1, 5, 2], [2, 6, 3], [3, 7, 0]])
    filled = _filled(np.array(rhombus + outer, dtype=float), around, [np.array([0, 3, 2, 1])])
    assert sorted(map(sorted, filled[4:].tolist())) == [[0, 1, 2], [0, 2, 3]]


def test_triangles_in_one_slanted_plane_turn_by_nothing_whatever_rounding_says() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        normal = rng.normal(size=3)
        across = np.linalg.svd(normal[None])[2][1:]
        corners = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]) @ across
        mesh = Mesh(corners, [[0, 1, 2], [0, 2, 3]])
        np.testing.assert_allclose(reconstruction._bends(mesh), 0, atol=1e-7)
        # Four boundary edges are four half turns, which are eight quarters; there is no fold.
        assert reconstruction.roughness(mesh) == pytest.approx(8, abs=1e-6)
        assert reconstruction.defects(mesh) == 4
        folded = Mesh(corners, [[0, 1, 2], [0, 3, 2]])
        assert reconstruction._bends(folded)[0] == pytest.approx(np.pi, abs=1e-6)
