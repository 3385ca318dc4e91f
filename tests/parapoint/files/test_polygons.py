"""Polygons of any size, cut into triangles in bounded time."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint.errors import InputError
from parapoint.files.polygons import triangle_rows


@pytest.mark.parametrize(
    ("sizes", "word"),
    [
        ([6000], "touches or crosses itself"),
        ([600] * 60, "touches or crosses itself"),
        ([249_000], "too many"),
    ],
)
def test_large_polygons_that_cross_themselves_are_refused_at_once(sizes, word):
    # Cutting by ears takes time by the cube of the corners: minutes for the first.
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]])
    corners = np.arange(sum(sizes)) % 3
    with pytest.raises(InputError, match=word):
        triangle_rows(vertices, np.array(sizes), corners)


def test_a_large_polygon_is_cut():
    angle = np.linspace(0, 2 * np.pi, 5000, endpoint=False)
    radius = 1 + 0.5 * np.random.default_rng(0).random(len(angle))
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], 1)
    rows = triangle_rows(ring, np.array([5000]), np.arange(5000))
    a, b, c = ring[rows].transpose(1, 0, 2)
    doubled = np.cross(b - a, c - a)[:, 2]
    assert (doubled > 0).all()
    x, y, _ = ring.T
    assert_allclose(doubled.sum(), (x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def test_polygons_are_cut_together_as_each_alone():
    draw = np.random.default_rng(0)
    sizes = draw.integers(3, 12, size=300)
    rings = [draw.integers(0, 4, size=(size, 3)).astype(float) for size in sizes]  # many cross
    for n in range(0, 300, 2):  # half of them are stars, some with corners inside straight edges
        angle = np.sort(draw.random(sizes[n])) * 2 * np.pi
        radius = draw.integers(1, 3, size=sizes[n])
        rings[n] = np.round(np.stack([3 * radius * np.cos(angle), 3 * radius * np.sin(angle)], 1))
        rings[n] = np.insert(rings[n], 2, 1.0, axis=1)
    starts = np.cumsum(sizes) - sizes
    together = triangle_rows(np.concatenate(rings), sizes, np.arange(sizes.sum()))
    alone = [
        start + triangle_rows(ring, np.array([len(ring)]), np.arange(len(ring)))
        for start, ring in zip(starts, rings, strict=True)
    ]
    assert (together == np.concatenate(alone)).all()


@pytest.mark.parametrize("unit", [1e-90, 1e90])
def test_polygons_are_cut_alike_in_every_unit(unit: float) -> None:
    """An arrowhead of four corners and one of five: products of their sides are no float64."""
    ring = np.array([[0, 0], [2, -1], [0.5, 0], [2, 1], [0, 0], [2, -1], [0.5, 0], [2, 1], [1, 1]])
    points = np.insert(ring, 2, 0.0, axis=1)
    rows = [triangle_rows(of * points, np.array([4, 5]), np.arange(9)) for of in (1.0, unit)]
    assert_array_equal(*rows)


@pytest.mark.parametrize("turn", range(4))
def test_a_quad_that_would_fold_is_a_fan_from_its_second_corner(turn: int) -> None:
    arrow = np.roll([[0, 0, 0], [2, -1, 0], [0.5, 0, 0], [2, 1, 0.0]], turn, axis=0)
    rows = triangle_rows(arrow, np.array([4]), np.arange(4))
    assert rows.tolist() == ([[1, 2, 3], [1, 3, 0]] if turn % 2 else [[0, 1, 2], [0, 2, 3]])


def test_corners_inside_straight_edges_keep_their_triangles():
    # Earcut leaves such corners out; each must be part of a triangle that turns as the polygon.
    ring = np.array([[0, 0], [1, 0], [2, 0], [4, 0], [4, 4], [2, 1], [0, 4], [0, 3], [0, 1.0]])
    rows = triangle_rows(np.insert(ring, 2, 0.0, axis=1), np.array([9]), np.arange(9))
    a, b, c = ring[rows].transpose(1, 0, 2)
    doubled = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert set(rows.ravel().tolist()) == set(range(9))
    assert (doubled >= 0).all()
    assert_allclose(doubled.sum() / 2, 10.0)


@pytest.mark.parametrize("shift", range(4))
@pytest.mark.parametrize("turn", [1, -1])
def test_quads_of_the_same_corners_are_cut_along_the_same_diagonal(shift: int, turn: int) -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 1, 0]])
    quads = np.stack([np.arange(4), np.roll(np.arange(4)[::turn], shift)])
    corners = quads.reshape(-1)
    triangles = np.sort(corners[triangle_rows(square, np.array([4, 4]), corners)], axis=1)
    one, other = (set(map(tuple, half.tolist())) for half in np.split(triangles, 2))
    assert one == other == {(0, 1, 2), (0, 2, 3)}
