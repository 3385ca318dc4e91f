"""Polygons of any size, cut into triangles in bounded time."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

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
