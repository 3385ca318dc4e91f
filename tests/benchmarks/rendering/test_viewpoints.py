"""From where shapes are seen whose front is known."""

import igl
import numpy as np
import pytest

from benchmarks.rendering.scene import Scene
from benchmarks.rendering.viewpoints import two_cameras, upright
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh


def sphere() -> tuple[FloatArray, IntArray]:
    vertices, faces = igl.upsample(*igl.icosahedron(), 3)
    return vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces


@pytest.mark.parametrize("side", [1, -1])
def test_a_face_is_seen_at_three_quarters(side: int) -> None:
    """A ball with a nose, symmetric to the plane of its upright axis (y) and the nose (± x)."""
    vertices, faces = sphere()
    nose = np.exp(-8 * ((vertices - [side, 0, 0]) ** 2).sum(axis=1, keepdims=True))
    first, second = two_cameras(Scene(Mesh(vertices * (1 + 0.5 * nose), faces), shadows=False))
    level = first.axes[2] * [1, 0, 1]
    cosine = side * level[0] / np.linalg.norm(level)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(37.5, abs=0.1)
    assert second.axes[2][0] * side < 0


@pytest.mark.parametrize("side", [1, -1])
def test_the_bumpy_side_is_the_front(side: int) -> None:
    """Both sides of a sheared ball fill as much of a picture; one of them is bumpy."""
    vertices, faces = sphere()
    x, y, z = vertices.T
    bumps = 0.25 * np.sin(7 * x + 1) * np.cos(6 * y) * np.clip(z, 0, 1)
    ball = np.stack([side * (0.8 * x + 0.7 * y), y, side * (0.7 * z + bumps)], axis=1)
    first, second = two_cameras(Scene(Mesh(ball, faces), shadows=False))
    assert first.axes[2][2] * side > 0.5
    assert second.axes[2][2] * side < 0


def test_a_bust_stands_on_its_neck_whichever_way_its_faces_turn() -> None:
    vertices, faces = sphere()
    kept = faces[(vertices[faces][..., 2] > -0.7).all(axis=1)]
    for turned in (kept, kept[:, ::-1]):
        np.testing.assert_array_equal(upright(Mesh(vertices, turned)), [0, 0, 1])
