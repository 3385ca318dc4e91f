"""From the cells of points to a map: what is handed to a method, and what is said of the result."""

import numpy as np
import pytest
import torch

from baselines.neural.grid_method import GridMethod
from baselines.neural.point_grid import centres
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import sphere


class Held(GridMethod):
    """Puts points into cells in their order, and keeps what it was given."""

    def cells(self, points, drawn, side, seed):
        self.given.append((points, drawn, side, seed))
        return np.arange(len(points)), (), {"more": 1}


@pytest.fixture
def given(monkeypatch):
    """What the method was given, call by call."""
    calls = []
    monkeypatch.setattr(Held, "given", calls, raising=False)
    return calls


def test_a_method_is_given_the_points_in_a_ball_of_radius_1_and_some_to_learn_from(given):
    corners = np.array([[x, y, z] for x in (0, 2) for y in (0, 2) for z in (0, 2)])
    inside = np.random.default_rng(0).uniform(0.5, 1, (142, 3))
    cloud = PointCloud(5 * np.concatenate([corners, inside]) + [7, 8, 9])
    result = Held(points=120).parameterize(cloud, seed=4)
    ((points, drawn, side, seed),) = given
    np.testing.assert_allclose(points, (np.concatenate([corners, inside]) - 1) / np.sqrt(3))
    assert drawn.shape == (120, 3)
    assert len(set(map(tuple, drawn))) == 120
    assert set(map(tuple, drawn)) < set(map(tuple, points))
    assert (side, seed) == (13, 4)
    np.testing.assert_allclose(result.uv, 5 * np.sqrt(3) * centres(13)[:150])
    wanted = {"points": 120, "iterations": 0, "losses": {}, "side": 13, "collisions": 0, "more": 1}
    assert {name: result.report[name] for name in wanted} == wanted
    assert result.report["filled_cells"] == pytest.approx(150 / 169)


def test_vertices_of_no_face_have_no_cell(given):
    ball = sphere()
    points = np.insert(ball.vertices, [0, 40], 9.0, axis=0)
    faces = ball.faces + 1 + (ball.faces >= 40)
    result = Held().parameterize(Mesh(points, faces), seed=0)
    assert len(given[0][0]) == len(result.uv) == 90
    np.testing.assert_array_equal(result.corners, ball.faces)


def test_a_gpu_makes_no_difference_to_a_method_that_does_not_train_on_it(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert Held().deterministic
