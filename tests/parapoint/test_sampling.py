import math

import numpy as np
import pytest

from parapoint import Mesh
from parapoint.sampling import hull_sample, surface_sample, training_points
from parapoint.testing import irregular_disk


def test_training_points_come_from_the_vertices_or_from_the_faces_where_these_are_few() -> None:
    disk = irregular_disk()
    points = training_points(disk, 150, 0)
    assert len(points) == 150
    rng = np.random.default_rng(1)
    many = rng.uniform(size=(3000, 3))
    mesh = Mesh(many, np.arange(2700).reshape(-1, 3))  # 300 vertices are in no face
    drawn = training_points(mesh, 500, 0)
    used = {tuple(row) for row in many[:2700]}
    assert len({tuple(row) for row in drawn}) == 500
    assert all(tuple(row) in used for row in drawn)
    assert len(training_points(mesh, 10_000, 0)) == 2700
    assert not np.array_equal(training_points(mesh, 500, 1), drawn)


def test_hull_points_lie_on_the_hull_and_are_spread_by_area() -> None:
    rng = np.random.default_rng(0)
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 4)], float)
    cloud = np.concatenate([corners, rng.uniform(0.2, 0.8, (50, 3)) * [1, 1, 4]])
    points = hull_sample(cloud, 4000, 0)
    on_face = (np.isclose(points, 0) | np.isclose(points, [1, 1, 4])).any(axis=1)
    assert on_face.all()
    ends = np.isclose(points[:, 2], 0) | np.isclose(points[:, 2], 4)
    # 2 of 18 units of area; five standard deviations of a binomial of 4,000.
    assert ends.mean() == pytest.approx(2 / 18, abs=5 * math.sqrt(2 / 18 * 16 / 18 / 4000))


def test_a_planar_cloud_is_its_own_hull() -> None:
    flat = np.column_stack([np.random.default_rng(0).uniform(size=(150, 2)), np.zeros(150)])
    assert np.array_equal(hull_sample(flat, 150, 0), flat)


def test_surface_samples_are_uniform_by_area() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 5], [3, 0, 5], [0, 1, 5]])
    faces = np.array([[0, 1, 2], [3, 4, 5]])
    points = surface_sample(vertices, faces, 4000, 3)
    assert np.isclose(points[:, 2], 5).mean() == pytest.approx(0.75, abs=0.04)
    below = points[points[:, 2] < 1]
    np.testing.assert_allclose(below.mean(axis=0), [1 / 3, 1 / 3, 0], atol=0.04)
    assert (below[:, 0] + below[:, 1] <= 1 + 1e-12).all()
