"""Vertices at one place: what counts as one, and what stays apart."""

import numpy as np
import pytest

from parapoint.surfaces.cutting import cut_along
from parapoint.surfaces.places import first_of_each, places
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere


def soup(mesh: Mesh) -> Mesh:
    """The mesh with a vertex of its own at each corner."""
    return Mesh(mesh.vertices[mesh.faces.reshape(-1)], np.arange(mesh.faces.size).reshape(-1, 3))


def test_each_row_is_led_to_the_first_of_its_number() -> None:
    assert first_of_each(np.array([7, 2, 7, 2, 0])).tolist() == [0, 1, 0, 1, 4]


def test_a_chain_of_near_points_is_one_place() -> None:
    points = np.array([[0.0, 0], [0.9, 0], [1.8, 0], [3.0, 0]])
    assert first_of_each(places(points, 1.0)).tolist() == [0, 0, 0, 3]
    assert first_of_each(places(points)).tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("noise", [0, 1e-16, 1e-9])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_a_soup_is_welded_in_any_unit_and_as_any_writer_rounds_it(noise, unit) -> None:
    ball = sphere()
    apart = soup(ball)
    moved = apart.vertices + noise * np.random.default_rng(0).normal(size=apart.vertices.shape)
    welded = Mesh(unit * moved, apart.faces).welded
    assert welded.component_count == 1
    assert welded.referenced.sum() == len(ball.vertices)
    assert welded.is_manifold
    assert not welded.boundary_loops


def test_vertices_in_single_precision_are_welded() -> None:
    ball = sphere()
    turned = ball.vertices @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    rounded = turned.astype(np.float32).astype(float)
    corners = ball.faces.reshape(-1)
    is_odd = np.arange(len(corners))[:, None] % 2 == 1
    apart = Mesh(np.where(is_odd, turned[corners], rounded[corners]), soup(ball).faces)
    assert apart.welded.component_count == 1


def test_small_things_that_lie_far_apart_keep_their_vertices() -> None:
    """Two disks a million sizes apart: a share of the whole diagonal is longer than their edges."""
    disk = irregular_disk()
    count = len(disk.vertices)
    both = Mesh(
        np.concatenate([disk.vertices, disk.vertices + 1e8]),
        np.concatenate([disk.faces, disk.faces + count]),
    )
    assert np.array_equal(both.welded.faces, both.faces)


def test_a_vertex_without_faces_far_away_changes_nothing() -> None:
    ball = soup(sphere())
    far = Mesh(np.concatenate([ball.vertices, [[1e9, 0, 0]]]), ball.faces)
    assert np.array_equal(far.welded.faces, ball.welded.faces)


def test_a_cut_mesh_is_closed_again() -> None:
    ball = sphere()
    around = ball.edges[(ball.edges == ball.edges[0, 0]).any(axis=1)]
    cut = cut_along(ball, around)
    assert cut.boundary_loops
    assert np.array_equal(cut.welded.faces, ball.faces)
