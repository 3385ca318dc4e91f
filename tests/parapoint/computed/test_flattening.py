from unittest.mock import Mock

import numpy as np
import pytest

from benchmarks.cases.builtin import sphere, torus
from parapoint.computed import flattening
from parapoint.computed.flattening import (
    FlatMap,
    _chosen_copies,
    _vertex_jacobians,
    flat_map,
)
from parapoint.computed.reconstruction import ReconstructionError, triangulation
from parapoint.errors import InputError
from parapoint.planar.embedding import few_edges_graph
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import cut_along
from parapoint.surfaces.surface import Mesh

SPHERE, TORUS = sphere().vertices, torus().vertices


def distances(points: np.ndarray) -> np.ndarray:
    return np.linalg.norm(points[:, None] - points, axis=2)


def plane() -> np.ndarray:
    xy = np.random.default_rng(0).uniform(size=(400, 2))
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    return np.pad(xy, ((0, 0), (0, 1))) @ turn


def angles_kept(flat: FlatMap) -> np.ndarray:
    """(A,) ratio of the singular values of each Jacobian, 1 where the map is conformal."""
    values = np.linalg.svd(flat.jacobians, compute_uv=False)
    return values[:, 1] / values[:, 0]


def test_a_plane_keeps_its_distances() -> None:
    points = plane()
    flat = flat_map(points)
    assert np.array_equal(flat.anchors, np.arange(400))
    np.testing.assert_allclose(distances(flat.uv), distances(points), atol=1e-6)
    assert flat.facts["seam_edges"] == 0
    assert flat.facts["genus"] == 0


def test_a_half_cylinder_is_unrolled() -> None:
    # The rows are rings of straight-sided strips: the triangulation itself is developable.
    turn, height = np.meshgrid(np.linspace(0, np.pi, 25), np.linspace(0, 2, 17))
    turn, height = turn.ravel(), height.ravel()
    flat = flat_map(np.column_stack([np.cos(turn), np.sin(turn), height]))
    side = 2 * np.sin(np.pi / 48) * 24 / np.pi
    unrolled = np.column_stack([side * turn, height])
    np.testing.assert_allclose(distances(flat.uv), distances(unrolled), atol=1e-5)


@pytest.mark.parametrize(("points", "genus"), [(SPHERE, 0), (TORUS, 1)])
def test_a_closed_surface_is_cut_and_nearly_conformal(points: np.ndarray, genus: int) -> None:
    flat = flat_map(points)
    assert flat.facts["genus"] == genus
    assert flat.facts["boundary_loops"] == 0
    assert flat.facts["seam_edges"] > 0
    assert np.median(angles_kept(flat)) > 0.85


def test_a_thin_pin_on_a_plate_is_mapped() -> None:
    # Six points around and sixty rings: in Tutte's embedding its tip is too small for numbers.
    x, y = (side.ravel() for side in np.meshgrid(*[np.linspace(-3, 3, 31)] * 2))
    outside = np.hypot(x, y) > 0.3
    ring, place = (rows.ravel() for rows in np.indices((60, 6)))
    turn = (place + ring % 2 / 2) * np.pi / 3
    plate = np.column_stack([x, y, 0 * x])[outside]
    pin = np.column_stack([0.2 * np.cos(turn), 0.2 * np.sin(turn), 0.17 * ring])
    points = np.concatenate([plate, pin, [[0, 0, 10.15]]])
    flat = flat_map(points)
    assert len(flat.anchors) == len(points)
    assert flat.facts["genus"] == 0
    assert flat.facts["boundary_loops"] == 1
    assert 60 <= flat.facts["seam_edges"] <= 90  # along the pin and from its foot to the rim
    assert np.median(angles_kept(flat)) > 0.9


def test_a_strip_that_hangs_into_a_hole_is_mapped() -> None:
    # Fifty triangles in a row: in Tutte's embedding each is a fraction of the one before.
    x, y = (side.ravel() for side in np.meshgrid(*[np.linspace(-5, 5, 51)] * 2))
    in_strip = (np.abs(x - 0.1) < 0.15) & (y < 1.01)
    points = np.column_stack([x, y, 0 * x])[(np.hypot(x, y) > 4) | in_strip]
    flat = flat_map(points)
    assert len(flat.anchors) == len(points)
    assert flat.facts["boundary_loops"] == 2
    assert 1 <= flat.facts["seam_edges"] <= 10  # from the rim of the plate to the hole
    assert np.median(angles_kept(flat)) > 0.9


def test_the_inverse_derivatives_undo_the_derivatives() -> None:
    flat = flat_map(SPHERE)
    back = flat.jacobians @ flat.inverse_jacobians
    close = np.abs(back - np.eye(2)).max(axis=(1, 2)) < 1e-9
    assert close.mean() > 0.95  # all but those where a seam squeezes the map flat


def test_the_map_is_the_same_each_time_and_scales_with_the_points() -> None:
    first, second = flat_map(SPHERE), flat_map(4 * SPHERE)
    assert np.array_equal(first.uv, flat_map(SPHERE).uv)
    np.testing.assert_allclose(second.uv, 4 * first.uv, atol=1e-6)


def test_points_without_a_surface_are_refused() -> None:
    parts = [SPHERE[::4] + np.array([4.0 * k, 0, 0]) for k in range(3)]
    with pytest.raises(ReconstructionError, match="holds 161 of 483 points"):
        flat_map(np.concatenate(parts))


def test_a_tube_is_slit_along_its_side_and_unrolled() -> None:
    # 24 columns and 9 rows at distance 1. Its two ends turn by 0 in the flat metric, not by 2π and
    # −2π, so eight edges join them, and it becomes a rectangle, not a ring: all steps along it and
    # around it stay 1, but for one in each row, which leads from one side to the other, 23 back.
    # The ends of the seam, in the first and the last row, may be on either side.
    ring, row = (of.ravel() for of in np.indices((24, 9)))
    turn, radius = 2 * np.pi * ring / 24, 1 / (2 * np.sin(np.pi / 24))
    flat = flat_map(np.stack([radius * np.cos(turn), radius * np.sin(turn), row], axis=1))
    assert flat.facts["boundary_loops"] == 2
    assert flat.facts["seam_edges"] == 8
    uv = flat.uv.reshape(24, 9, 2)[:, 1:-1]
    along = np.linalg.norm(np.diff(uv, axis=1), axis=2)
    around = np.sort(np.linalg.norm(np.roll(uv, -1, axis=0) - uv, axis=2), axis=0)
    np.testing.assert_allclose(along, 1, atol=1e-6)
    np.testing.assert_allclose(around[:-1], 1, atol=1e-6)
    np.testing.assert_allclose(around[-1], 23, atol=1e-6)


def grid(side: int) -> Mesh:
    """A square of side² vertices; vertex side · y + x, diagonals up to the right."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(side), np.arange(side)))
    corner = (side * np.arange(side - 1)[:, None] + np.arange(side - 1)).ravel()
    sides = [0, 1, side + 1], [0, side + 1, side]
    faces = np.concatenate([corner[:, None] + np.array(of) for of in sides])
    return Mesh(np.stack([x, y, 0 * x], axis=1), faces)


def edges_across(mesh: Mesh, path: list[int]) -> np.ndarray:
    """(n, 2) the edges between points on different sides, where the mesh is slit along a path."""
    disk = cut_along(mesh, np.stack([path[:-1], path[1:]], axis=1))
    origin = np.empty(len(disk.vertices), dtype=np.int64)
    origin[disk.faces] = mesh.faces
    chosen = _chosen_copies(disk, origin)
    joined = set(map(tuple, np.sort(disk.edges, axis=1).tolist()))
    images = map(tuple, np.sort(chosen[mesh.edges], axis=1).tolist())
    return mesh.edges[[pair not in joined for pair in images]]


def test_a_toothed_seam_runs_between_two_rows_of_points() -> None:
    # The slit goes up columns 5 and 6 of a grid whose cells have a diagonal up to the right. With
    # column 5 on its left side and 6 on its right the seam is crossed by the two edges to the right
    # of each of (5, 0) to (5, 3), less the slit's last edge: 7. With one side for all it is 10.
    path = [5, 16, 28, 27, 39, 38, 50]  # (5, 0), (5, 1), (6, 2), (5, 2), (6, 3), ...
    assert len(edges_across(grid(11), path)) == 7


def test_no_point_has_most_of_its_edges_across_the_seam() -> None:
    # A slit from (4, 0) up to the right that bends back down. The fewest edges are across where the
    # point at its bend, of six edges, has four of them across: it would be a notch.
    mesh = grid(9)
    across = edges_across(mesh, [4, 14, 24, 33, 34, 25, 16])
    share = np.bincount(across.ravel(), minlength=81) / np.bincount(mesh.edges.ravel())
    assert 0 < share.max() <= 0.5


def test_a_vertex_s_derivative_is_the_mean_of_its_faces_by_area() -> None:
    # To the right of x = 0, area 1/2, the map is the identity; to the left, area 3/2, it doubles x.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [-3, 0, 0]])
    mesh = Mesh(points, [[0, 1, 2], [0, 2, 3]])
    uv = np.array([[0.0, 0], [1, 0], [0, 1], [-6, 0]])
    jacobians = _vertex_jacobians(mesh, uv)
    for vertex, slope in enumerate([1.75, 1.0, 1.75, 2.0]):
        np.testing.assert_allclose(jacobians[vertex], [[slope, 0, 0], [0, 1, 0]], atol=1e-12)


def test_a_cut_costs_its_length_and_its_edges() -> None:
    # The sides of a right triangle, 3, 4 and 5, each with their mean, 4.
    graph = few_edges_graph(Mesh([[0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 1, 2]])).toarray()
    np.testing.assert_allclose(graph, [[0, 7, 8], [7, 0, 9], [8, 9, 0]])


def test_a_map_keeps_the_area() -> None:
    # Of a cap that needs no cut each point has one image, so its triangulation has one, too.
    plane = np.random.default_rng(0).uniform(-1, 1, (900, 2))
    plane = plane[(plane**2).sum(axis=1) < 0.6]
    points = np.column_stack([plane, np.sqrt(1 - (plane**2).sum(axis=1))])
    flat, mesh = flat_map(points), triangulation(points)
    assert flat.facts["seam_edges"] == 0
    assert signed_areas(flat.uv, mesh.faces).sum() == pytest.approx(mesh.face_areas.sum())


@pytest.mark.parametrize(("step", "error"), [(1 / 30, InputError), (1.0, ReconstructionError)])
def test_scan_lines_without_a_surface_get_advice(monkeypatch, step: float, error: type) -> None:
    # A sheet of even points may still be trained; of lines no training would see more.
    x, y = (of.ravel() for of in np.meshgrid(np.arange(0, 20, step), np.arange(20.0)))
    monkeypatch.setattr(flattening, "bijective_map", Mock(side_effect=RuntimeError("no way")))
    with pytest.raises(error, match="no way"):
        flat_map(np.column_stack([x, y, 0.1 * np.sin(y)]))


def test_the_map_from_the_other_side_is_its_mirror_image_and_its_own_again_from_there() -> None:
    flat = flat_map(np.random.default_rng(3).uniform(0, 1, (150, 3)) * [2, 1, 0])
    turned = flat.turned()
    np.testing.assert_array_equal(turned.uv, flat.uv * [-1, 1])
    np.testing.assert_array_equal(turned.jacobians[:, 0], -flat.jacobians[:, 0])
    np.testing.assert_array_equal(turned.jacobians[:, 1], flat.jacobians[:, 1])
    images = np.einsum("nij,njk->nik", turned.jacobians, turned.inverse_jacobians)
    np.testing.assert_allclose(images, np.broadcast_to(np.eye(2), images.shape), atol=1e-6)
    np.testing.assert_array_equal(turned.turned().uv, flat.uv)
    held = turned.charted
    assert (signed_areas(held.map.uv, held.map.corners) > 0).all()


def test_a_vertex_whose_faces_have_no_area_has_no_derivative() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    mesh = Mesh(points, [[0, 1, 2], [0, 3, 1]])
    jacobians = _vertex_jacobians(mesh, points[:, :2])
    np.testing.assert_allclose(jacobians[:3], np.tile(np.eye(2, 3), (3, 1, 1)), atol=1e-12)
    np.testing.assert_array_equal(jacobians[3], 0)
