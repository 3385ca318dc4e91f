"""Normals and tangents of a sphere."""

import numpy as np

from parapoint.surfaces.normals import oriented_normals, tangent_frames


def sphere(count: int = 200) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def test_normals_are_oriented_alike() -> None:
    points = sphere(1000)
    outward = (oriented_normals(points) * points).sum(axis=1)
    assert np.abs(outward).min() > 0.9
    assert abs(np.sign(outward).sum()) == 1000
    two = np.concatenate([points, points + 10])  # two components are each oriented
    outward = (oriented_normals(two) * np.concatenate([points, points])).sum(axis=1)
    assert abs(np.sign(outward[:1000]).sum()) == abs(np.sign(outward[1000:]).sum()) == 1000


def test_tangent_frames_are_right_handed_around_the_normals() -> None:
    points = sphere(500)
    first, second = tangent_frames(points)
    np.testing.assert_allclose(np.cross(first, second), oriented_normals(points), atol=1e-12)
    np.testing.assert_allclose((first * second).sum(axis=1), 0, atol=1e-12)
