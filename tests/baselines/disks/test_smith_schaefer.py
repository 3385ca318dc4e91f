"""Smith and Schaefer's map: its energy, its barrier, its steps, and what the barrier changes."""

from collections import deque

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines.disks.barrier_energy import Boundary, Energy, turning_points
from baselines.disks.quasi_newton import direction
from baselines.disks.slim import SLIM
from baselines.disks.smith_schaefer import SmithSchaefer, descent
from parapoint.errors import InputError
from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import FlatteningError, domain, signed_areas
from parapoint.planar.tutte import tutte
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk


def ramp():
    """One and a quarter turns of a ramp around a pillar, almost flat: laid flat it meets itself."""
    turn, radius = (of.ravel() for of in np.meshgrid(np.linspace(0, 7.8, 27), [0.5, 1, 1.5, 2]))
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.02 * turn], axis=1)
    corner = (np.arange(3)[:, None] * 27 + np.arange(26)).ravel()
    faces = np.concatenate([corner[:, None] + side for side in ([0, 28, 1], [0, 27, 28])])
    return Mesh(points, faces)


def numeric_gradient(function, uv, step=1e-6):
    slope = np.zeros_like(uv)
    for at in np.ndindex(uv.shape):
        move = np.zeros_like(uv)
        move[at] = step
        slope[at] = (function(uv + move) - function(uv - move)) / (2 * step)
    return slope


def test_the_gradients_of_energy_and_barrier_are_their_differences():
    disk = domain(irregular_disk())
    uv = tutte(disk)
    energy = Energy(disk, 0.7)  # far enough that vertices near and past the ends of edges count
    assert energy.boundary.barrier(uv)[0] > 0
    slope = energy.of(uv)[1]
    assert_allclose(slope, numeric_gradient(lambda x: energy.of(x)[0], uv), atol=1e-6)


def test_the_energy_by_hand():
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1.0, 0]]), np.array([[0, 1, 2]]))
    distortion = Energy(domain(mesh), 1e-9).of(mesh.vertices[:, :2] * [2, 1])[2]
    assert distortion == pytest.approx(4 + 1 + 1 / 4 + 1)
    for flat in (-2, 0):
        assert Energy(domain(mesh), 1e-9).of(mesh.vertices[:, :2] * [flat, 1])[2] == np.inf


def test_the_barrier_by_hand():
    # The far corner is at a distance of 1/2 from the edge of length 1, the others at sqrt(1/2).
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0]]), np.array([[0, 1, 2]]))
    boundary = Boundary(domain(mesh), 0.6)
    assert boundary.barrier(mesh.vertices[:, :2])[0] == pytest.approx(0.2**2 / 3)


@pytest.mark.parametrize("across", [1, -1])
def test_past_its_ends_an_edge_is_as_far_as_its_nearer_end(across):
    """The tip lies half an edge past one end: 0.3 from the line, √0.34 from the edge."""
    tip = 0.5 + across
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [tip, 0.3, 0]]), np.array([[0, 1, 2]]))
    height = 0.3 / np.hypot(1.5, 0.3)  # of the end between the two others, over the longest edge
    found = Boundary(domain(mesh), 0.6).barrier(mesh.vertices[:, :2])[0]
    assert found == pytest.approx(((0.6 / 0.34**0.5 - 1) ** 2 + (0.6 / height - 1) ** 2) / 3)


def test_a_triangle_turns_over_where_the_root_says():
    corners = np.array([[[0, 0]], [[1, 0]], [[0, 1.0]]])
    move = np.array([[[0, 0]], [[0, 0]], [[0, -4.0]]])
    assert min(turning_points(corners, move))[0] == pytest.approx(0.25)
    grow = np.array([[[0, 0]], [[1, 0]], [[0, 1.0]]])
    assert np.isinf(min(turning_points(corners, grow))[0])


def test_a_step_ends_where_a_vertex_meets_an_edge():
    """Two triangles that hang together at the right, their tips moved towards one another."""
    points = np.array([[0, 1, 0], [2, 1, 0], [2, -1, 0], [0, -1, 0], [3, 0, 0.0], [1.2, 0.2, 0]])
    faces = np.array([[0, 5, 1], [1, 5, 4], [5, 2, 4], [5, 3, 2]])
    disk = domain(Mesh(points, faces))
    uv, move = points[:, :2], np.zeros((6, 2))
    move[3, 1] = 10
    boundary = Boundary(disk, 0.1)
    step = boundary.largest_step(uv, move, 1.0)
    assert 0 < step < 1
    mesh = Mesh(points, faces)
    assert not len(crossing_vertices(mesh, uv + 0.999 * step * move))
    assert len(crossing_vertices(mesh, uv + 1.001 * step * move))
    assert boundary.largest_step(uv, -move, 1.0) == 1.0


def test_the_remembered_steps_are_newton_s_on_a_quadratic():
    hessian = np.diag([1.0, 10.0, 100.0, 1000.0])
    x, pairs = np.ones((2, 2)), deque(maxlen=8)
    slope = (hessian @ x.ravel()).reshape(2, 2)
    for _ in range(12):
        move = direction(slope, pairs)
        step = -(move * slope).sum() / (move.ravel() @ hessian @ move.ravel())
        ahead = (hessian @ (x + step * move).ravel()).reshape(2, 2)
        pairs.append((step * move, ahead - slope))
        x, slope = x + step * move, ahead
    assert np.abs(x).max() < 1e-6


def test_the_boundary_that_slim_lays_over_itself_stays_apart():
    mesh = ramp()
    assert len(crossing_vertices(mesh, SLIM(iterations=200).parameterize(mesh, seed=0).uv))
    result = SmithSchaefer().parameterize(mesh, seed=0)
    assert result.report["bijective"]
    assert not len(crossing_vertices(mesh, result.uv))
    assert (signed_areas(result.uv, mesh.faces) > 0).all()


def test_every_step_of_the_trace_is_one_to_one_and_lowers_the_energy():
    mesh = irregular_disk()
    result = SmithSchaefer(iterations=60).parameterize(mesh, seed=0)
    values = [point.values["symmetric_dirichlet"] for point in result.trace]
    assert values[-1] < values[0] - 0.5
    assert values[20] < 4.02  # down the slope alone it comes to 4.2 by then
    isometric = SLIM(iterations=60).parameterize(mesh, seed=0)  # no part of it meets another
    assert values[-1] == pytest.approx(isometric.report["end_energy"], abs=1e-6)
    assert [point.iteration for point in result.trace] == list(range(len(values)))
    assert values[-1] == result.report["end_energy"]
    assert_array_equal(result.trace[-1].uv, result.uv)
    for point in result.trace:
        if point.uv is not None:
            assert (signed_areas(point.uv, mesh.faces) > 0).all()
            assert not len(crossing_vertices(mesh, point.uv))


def test_a_descent_ends_at_its_time():
    result = SmithSchaefer(time_budget=1e-9).parameterize(irregular_disk(), seed=0)
    assert result.report["iterations"] == 0
    assert not SmithSchaefer(time_budget=1.0).deterministic
    with pytest.raises(InputError, match="time_budget must be a number above 0"):
        SmithSchaefer(time_budget=0.0)


def test_an_isometry_is_where_the_descent_ends_at_once():
    """Tutte's embedding of a flat regular hexagon is the hexagon itself."""
    angle = np.arange(6) * np.pi / 3
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    faces = np.stack([np.full(6, 6), np.arange(6), (np.arange(6) + 1) % 6], axis=1)
    mesh = Mesh(np.vstack([3 * rim, [[0, 0, 0]]]), faces)
    report = SmithSchaefer().parameterize(mesh, seed=0).report
    assert report["start_energy"] == pytest.approx(4)
    assert report["iterations"] == 0


def test_a_descent_ends_where_a_hundred_steps_bring_less_than_a_hundredth():
    trace = SmithSchaefer().parameterize(irregular_disk(), seed=0).trace
    excess = np.array([point.values["symmetric_dirichlet"] for point in trace]) - 4
    settled = excess[100:] > 0.99 * excess[:-100]
    assert np.flatnonzero(settled).tolist() == [len(trace) - 101]


def test_a_step_goes_most_of_the_way_to_a_flip_and_one_at_most():
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1.0, 0]]), np.array([[0, 1, 2]]))
    energy = Energy(domain(mesh), 1e-9)
    down = np.array([[0, 0], [0, 0], [0, -4.0]])  # turns the triangle over after a quarter of it
    assert energy.largest_step(mesh.vertices[:, :2], down) == pytest.approx(0.9 / 4)
    assert energy.largest_step(mesh.vertices[:, :2], down / 400) == pytest.approx(1)
    assert energy.largest_step(mesh.vertices[:, :2], -down) == pytest.approx(1)


class Bowl:
    """An energy with its minimum at 0, and no bound on steps."""

    def __init__(self, steepness):
        self.steepness = steepness

    def of(self, uv):
        value = 4 + self.steepness * (uv**2).sum()
        return value, 2 * self.steepness * uv, value

    def largest_step(self, *_):
        return 1.0


@pytest.mark.parametrize("steepness", [1e-3, 1e6])
def test_the_first_step_is_as_long_however_steep_the_energy_is(steepness):
    """The bottom is half a step away: a whole step brings nothing, half a step all."""
    (_, start), (bottom, end) = descent(Bowl(steepness), np.array([[0.3, -0.5], [0.5, 0.1]]), 50)
    assert start > end == pytest.approx(4)
    assert_allclose(bottom, 0, atol=1e-12)


class Pit(Bowl):
    """Flat far away: towards the pit the slope grows at first, and falls near its bottom."""

    def of(self, uv):
        depth = np.exp(-(uv**2).sum())
        return 5 - depth, 2 * uv * depth, 5 - depth


def test_steps_down_a_slope_that_grows_are_not_remembered(monkeypatch):
    """A quadratic would have its top there, and not its bottom ahead."""
    remembered = []

    def spy(slope, pairs):
        remembered.append(len(pairs))
        return direction(slope, pairs)

    monkeypatch.setattr("baselines.disks.smith_schaefer.direction", spy)
    *_, (bottom, end) = descent(Pit(1.0), np.array([[2.2, 0.0]]), 50)
    assert remembered[:3] == [0, 0, 1]  # from 2.2 to 1.2, to 0.2
    assert_allclose(bottom, 0, atol=1e-3)
    assert end == pytest.approx(4, abs=1e-5)


def test_where_the_remembered_steps_mislead_the_slope_leads_on(monkeypatch):
    monkeypatch.setattr(
        "baselines.disks.smith_schaefer.direction",
        lambda slope, pairs: slope if pairs else -slope,  # up, once there is something to remember
    )
    *_, (bottom, end) = descent(Bowl(1.0), np.array([[0.3, -0.4], [0.2, 0.1]]), 50)
    assert end == pytest.approx(4, abs=1e-5)
    assert_allclose(bottom, 0, atol=1e-2)


def test_a_start_with_flips_is_refused(monkeypatch):
    monkeypatch.setattr("baselines.disks.smith_schaefer.tutte", lambda disk: tutte(disk) * [1, -1])
    with pytest.raises(FlatteningError, match="the start, has flipped triangles"):
        SmithSchaefer().parameterize(irregular_disk(), seed=0)
