"""Tutte's embedding by two routes, and the cuts that give room."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import domain
from parapoint.planar.embedding import embeddable, embedded_in_disk, few_edges_graph
from parapoint.planar.tutte import tutte
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk


def grid(columns: int, rows: int) -> Mesh:
    """A flat grid of vertices, one unit apart, row by row."""
    x, y = (of.ravel() for of in np.meshgrid(np.arange(columns), np.arange(rows)))
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    sides = [0, 1, columns + 1], [0, columns + 1, columns]
    faces = np.concatenate([corner[:, None] + side for side in sides])
    return Mesh(np.column_stack([x, y, 0.0 * x]), faces)


def with_a_tooth() -> Mesh:
    """A square of 5 x 5 vertices with a hole into which one triangle hangs by its edge.

    The middle vertex, row 12, is a corner of this triangle alone.
    """
    mesh = grid(5, 5)
    around = (mesh.faces == 12).any(axis=1)
    around[np.flatnonzero(around)[0]] = False
    return Mesh(mesh.vertices, mesh.faces[~around])


def test_a_wheel_has_its_hub_at_the_mean_of_its_rim():
    angle = np.radians([0, 90, 180, 270])
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    hub = [[0.4, -0.3, 0.0]]
    mesh = Mesh(np.concatenate([rim, hub]), [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    for uv in (embedded_in_disk(mesh), np.sqrt(np.pi) * tutte(domain(mesh))):
        assert_allclose(uv[4], 0, atol=1e-12)
        assert_allclose(np.linalg.norm(uv[:4], axis=1), np.linalg.norm(uv[0]))
    # The embedding fills the disk; the map of the method has the area of the surface, 2.
    assert_allclose(np.linalg.norm(embedded_in_disk(mesh)[:4], axis=1), 1)
    assert_allclose(signed_areas(tutte(domain(mesh)), mesh.faces).sum(), 2)


def test_the_two_embeddings_agree_up_to_a_turn_and_a_scale():
    mesh = irregular_disk()
    one, other = (uv @ [1, 1j] for uv in (embedded_in_disk(mesh), tutte(domain(mesh))))
    ratio = np.vdot(other, one) / np.vdot(other, other)
    assert_allclose(one, ratio * other, atol=1e-10)


def test_inner_vertices_are_at_the_mean_of_their_neighbours():
    mesh = irregular_disk()
    for uv in (embedded_in_disk(mesh), tutte(domain(mesh))):
        for vertex in (10, 40, 70):
            beside = np.unique(mesh.edges[(mesh.edges == vertex).any(axis=1)])
            around = uv[beside[beside != vertex]]
            assert_allclose(uv[vertex], around.mean(axis=0), atol=1e-10)


def test_a_triangle_that_hangs_into_a_hole_gets_room():
    mesh = with_a_tooth()
    assert len(mesh.boundary_loops) == 2
    for uv in (embedded_in_disk(mesh), tutte(domain(mesh))):
        areas = signed_areas(uv, mesh.faces)
        assert areas.min() > 1e-3 * areas.max()
    assert_allclose(signed_areas(tutte(domain(mesh)), domain(mesh).faces).sum(), 16 - 5 / 2)


@pytest.mark.parametrize("tall", [8, 120])
def test_a_tube_is_cut_only_where_it_is_too_tall_for_numbers(tall):
    # A horn: rings of three vertices on one another above a rim, and a tip.
    turn = 2 * np.pi * np.arange(3) / 3
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    points = np.column_stack([np.tile(ring, (tall, 1)), np.repeat(np.arange(tall), 3)])
    points = np.concatenate([points, [[0, 0, tall]]])
    corner = np.arange(3 * (tall - 1))
    beside = np.where(corner % 3 == 2, corner - 2, corner + 1)
    last = np.arange(3) + 3 * (tall - 1)
    faces = np.concatenate([
        np.stack([corner, beside, beside + 3], axis=1),
        np.stack([corner, beside + 3, corner + 3], axis=1),
        np.stack([last, np.roll(last, -1), np.full(3, 3 * tall)], axis=1),
    ])  # fmt: skip
    mesh = Mesh(points, faces)
    found = embeddable(mesh)
    assert (found is mesh) == (tall == 8)
    assert found.is_planar_domain
    areas = signed_areas(embedded_in_disk(found), found.faces)
    assert areas.min() > 1e-22
    # A cut to the tip: it opens along one side of the horn and no further.
    assert len(found.vertices) - len(mesh.vertices) == (tall if tall == 120 else 0)


def test_a_path_of_few_edges_is_preferred():
    mesh = grid(3, 2)
    graph = few_edges_graph(mesh)
    lengths = np.array([1.0] * 7 + [np.sqrt(2)] * 2)
    assert graph[0, 1] == graph[1, 0] == pytest.approx(1 + lengths.mean())
    assert graph[0, 4] == pytest.approx(np.sqrt(2) + lengths.mean())
    assert graph[0, 2] == graph[0, 5] == 0


def test_only_boundary_edges_that_meet_others_are_reported():
    mesh = grid(4, 2)
    uv = mesh.vertices[:, :2].copy()
    assert len(crossing_vertices(mesh, uv)) == 0
    # The strip rolls up: its last two vertices, 3 and 7, come to lie on the edge of its first.
    uv[[3, 7]] = [[-0.5, 0.4], [0.5, 0.4]]
    found = crossing_vertices(mesh, uv)
    assert set(found) >= {0, 3, 4, 7}
    # Vertices that two edges share are no crossing; a touch is one.
    touching = mesh.vertices[:, :2].copy()
    touching[7] = [1.5, 1.0]
    assert {5, 6, 7} <= set(crossing_vertices(mesh, touching))
