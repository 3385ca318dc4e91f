"""Points on a square grid: sharing out, jumps, Flattening-Net and RegGeoNet; what each changes."""

import dataclasses

import numpy as np
import pytest
import torch

from baselines.neural import (
    flattening_net,
    flattening_net_networks,
    reggeonet,
    reggeonet_networks,
)
from baselines.neural.flattening_net import FlatteningNet
from baselines.neural.flattening_net_networks import folded, transport
from baselines.neural.point_grid import (
    arranged,
    blocks,
    centres,
    jumps,
    side_for,
    squared_distances,
)
from baselines.neural.reggeonet import RegGeoNet, farthest, fitted_to, flattened, steps_ahead
from baselines.neural.reggeonet_networks import repulsion, smoothness
from parapoint.errors import InputError
from parapoint.learned.losses import wrap_loss
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import irregular_disk, sphere

BOTH = (FlatteningNet, RegGeoNet)


def sheet(side=20):
    """(side², 3) a bent square of points, row by row."""
    x, y = centres(side).T
    return np.stack([x, y, 0.3 * x**2], axis=1)


def ball(count=400):
    points = np.random.default_rng(0).normal(size=(count, 3))
    return PointCloud(points / np.linalg.norm(points, axis=1, keepdims=True))


@pytest.mark.parametrize(
    ("count", "side"), [(1, 1), (4, 2), (5, 3), (9, 3), (10, 4), (35_002, 188)]
)
def test_the_grid_is_the_smallest_that_holds_the_points(count, side):
    assert side_for(count) == side


def test_blocks_part_the_grid_evenly():
    block = blocks(7, 3)
    assert np.bincount(block @ [3, 1]).tolist() == [4, 6, 4, 6, 9, 6, 4, 6, 4]
    assert block.reshape(7, 7, 2)[:, 0, 0].tolist() == [0, 0, 1, 1, 1, 2, 2]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_points_that_lie_where_cells_are_go_there_whatever_the_blocks(count):
    places = sheet()
    order = np.random.default_rng(0).permutation(400)[:390]
    points = places[order]

    def costs(rows, cells):
        return squared_distances(points[rows], places[cells])

    cell = arranged(points, places, blocks(20, count), costs)
    # Empty cells are shared out too, so that beside the border of a block a few points move on.
    assert (cell == order).mean() > (0.99 if count == 1 else 0.8)
    assert len(np.unique(cell)) == 390
    if count == 1:
        assert (cell == order).all()


def test_points_are_shared_out_at_the_least_sum_of_squared_distances():
    """Both points are nearer to the first of two cells; the other one gains more of it.

    0 + (0.94² + 0.9²) = 1.69 for the points in their order, (0.06² + 0.9²) + 1 = 1.81 otherwise.
    """
    points, places = np.array([[0, 0, 0], [0.06, 0.9, 0]]), np.array([[0, 0, 0], [1.0, 0, 0]])
    for order in ([0, 1], [1, 0]):
        cell = arranged(
            points[order], places, np.array([[0, 0], [0, 1]]), lambda *_: np.zeros((1, 1))
        )
        assert cell.tolist() == order


def test_crowded_points_still_have_a_cell_each():
    places = sheet()
    points = np.repeat(places[:40], 10, axis=0)
    cell = arranged(
        points, places, blocks(20, 4), lambda rows, cells: np.zeros((len(rows), len(cells)))
    )
    assert sorted(cell) == list(range(400))


def test_jumps_by_hand():
    points = sheet()
    assert jumps(points, np.arange(400), 20) == 0
    halves = np.arange(400).reshape(20, 20)
    swapped = np.concatenate([halves[10:], halves[:10]]).ravel()  # one row of 20 steps jumps
    assert jumps(points, swapped, 20) == pytest.approx(20 / (2 * 20 * 19))


@pytest.mark.parametrize(("gap", "share"), [(3.5, 0), (4.5, 1 / 3)])
def test_a_jump_is_farther_than_four_times_to_the_nearest_point(gap, share):
    """In a row of four cells the points lie 1 apart, but for the gap in their middle."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1 + gap, 0, 0], [2 + gap, 0, 0]])
    assert jumps(points, np.arange(4), 4) == pytest.approx(share)


def test_transport_assigns_all_points_where_the_nearest_one_would_take_one_twice():
    made, given = torch.tensor([[0.0, 0, 0], [1, 0, 0]]), torch.tensor([[0.0, 0, 0], [-2, 0, 0]])
    assert transport(made, given).item() == pytest.approx((4 + 1) / 2)


def test_the_losses_of_the_embedding_by_hand():
    places = torch.tensor([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])  # a cell is 1
    near = torch.tensor([[1], [0], [3], [2]])
    assert smoothness(places, near).item() == pytest.approx(1)
    assert smoothness(2 * places, near).item() == pytest.approx(4)
    assert repulsion(places).item() == pytest.approx(2 * 0.5**2 + (1.5 - 2**0.5) ** 2, abs=1e-5)
    assert repulsion(2 * places).item() == 0


def test_six_nearest_others_are_kept_together(monkeypatch):
    asked = []

    def spy(_, near):
        asked.append(near)
        return torch.ones(())

    monkeypatch.setattr(reggeonet_networks, "smoothness", spy)
    anchors = ball(20).points.copy()
    _, (row,) = reggeonet_networks.embedded(anchors, 1, None, seed=0)
    assert row.values["smoothness"] == pytest.approx(0.3)
    nearest = squared_distances(anchors, anchors).argsort(axis=1)[:, 1:7]
    assert asked[0].tolist() == nearest.tolist()


def test_anchors_lie_far_from_one_another():
    points = ball(500).points
    anchors = farthest(points, 20)
    spread = squared_distances(anchors, anchors) + 4 * np.eye(20)
    drawn = points[:20]
    assert spread.min() > 4 * (squared_distances(drawn, drawn) + 4 * np.eye(20)).min()


def test_a_patch_lies_in_its_plane_turned_towards_the_anchors_around():
    flat = np.random.default_rng(0).uniform(-1, 1, (40, 2))
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    points = np.pad(flat, ((0, 0), (0, 1))) @ turn + 5
    for axes in (np.eye(2), np.array([[0, 1], [1, 0]]), np.diag([-1, 1])):
        ahead = 3 * np.pad(axes, ((0, 0), (0, 1))) @ turn
        found = flattened(points, ahead)
        np.testing.assert_allclose(found, (flat - flat.mean(axis=0)) @ axes.T, atol=1e-12)
    # One point, or points on a line along an axis, lie at the first border of what they fill.
    np.testing.assert_allclose(fitted_to(found[:1], centres(4)), [[-0.75, -0.75]])
    np.testing.assert_allclose(
        fitted_to([[3, 5], [4, 5]] * np.ones((2, 2)), centres(4))[:, 1], -0.75
    )
    filled = fitted_to(found, centres(4))
    assert filled.min(axis=0) == pytest.approx([-0.75, -0.75])
    assert filled.max(axis=0) == pytest.approx([0.75, 0.75])


def test_the_way_to_the_anchors_ahead():
    ahead = steps_ahead(np.stack([*np.mgrid[:3, :3], np.zeros((3, 3))], axis=2))
    np.testing.assert_allclose(ahead, np.tile(np.eye(3)[:2], (9, 1, 1)))
    corners = steps_ahead(np.stack([*np.mgrid[:2, :2], np.zeros((2, 2))], axis=2))
    np.testing.assert_allclose(corners, np.tile(np.eye(3)[:2], (4, 1, 1)))
    np.testing.assert_allclose(steps_ahead(np.zeros((1, 1, 3))), np.eye(3)[None, :2])


@pytest.mark.parametrize("kind", BOTH)
@pytest.mark.parametrize("surface", [sphere(), irregular_disk(), ball()])
def test_no_two_points_share_a_cell_and_the_report_says_so(kind, surface):
    result = kind(iterations=5, subset=100).parameterize(surface, seed=0)
    count = len(surface.vertices if isinstance(surface, Mesh) else surface.points)
    assert len(np.unique(result.uv, axis=0)) == count
    assert result.report["collisions"] == 0
    assert result.report["side"] == side_for(count)
    assert result.report["filled_cells"] == count / side_for(count) ** 2
    assert 0 <= result.report["jumps"] < 1
    again = kind(iterations=5, subset=100).parameterize(surface, seed=0)
    assert (again.uv == result.uv).all()


@pytest.mark.parametrize("kind", BOTH)
def test_the_loss_falls(kind):
    trace = kind(iterations=100, subset=100).parameterize(ball(), seed=0).trace
    assert trace[-1].values["total"] < 0.6 * trace[0].values["total"]


def test_a_sheet_that_is_folded_onto_the_points_has_fewer_jumps():
    before, after = (
        FlatteningNet(iterations=steps, subset=100).parameterize(ball(), seed=0).report["jumps"]
        for steps in (1, 150)
    )
    assert after < 0.6 * before


def test_transport_lays_the_sheet_by_number_where_the_chamfer_distance_does_not(monkeypatch):
    """What Flattening-Net adds to FoldingNet's fit: as many cells as there are points."""
    rng = np.random.default_rng(0)
    crowd = rng.normal(size=(300, 3)) * [0.1, 0.1, 0] + [2, 0, 0]
    points = np.concatenate([crowd, rng.uniform(-1, 1, (100, 3)) * [1, 1, 0]]) - [1, 0, 0]

    def share_in_the_crowd():
        places, _ = folded(points, 20, 100, 150, None, seed=0)
        return (places[:, 0] > 0).mean()

    assert share_in_the_crowd() == pytest.approx(0.75, abs=0.05)
    monkeypatch.setattr(flattening_net_networks, "transport", wrap_loss)
    assert abs(share_in_the_crowd() - 0.75) > 0.08


def test_each_part_of_reggeonet_takes_jumps_away(monkeypatch):
    """Anchors that are embedded, and patches that are flattened and turned towards the next."""
    cloud, rng = ball(900), np.random.default_rng(0)
    method = RegGeoNet(iterations=150)

    def found():
        return method.parameterize(cloud, seed=0).report["jumps"]

    embedding = reggeonet_networks.embedded(farthest(cloud.points, 64), 150, None, seed=0)
    monkeypatch.setattr(reggeonet_networks, "embedded", lambda *_, **__: embedding)
    whole = found()
    with monkeypatch.context() as changed:
        scattered = rng.uniform(-1, 1, (64, 2)), ()
        changed.setattr(reggeonet_networks, "embedded", lambda *_, **__: scattered)
        assert whole < 0.9 * found()
    with monkeypatch.context() as changed:
        changed.setattr(
            reggeonet, "flattened", lambda points, _: rng.uniform(size=(len(points), 2))
        )
        assert whole < 0.9 * found()
    with monkeypatch.context() as changed:
        changed.setattr(reggeonet, "flattened", lambda points, _: flattened(points, np.eye(3)[:2]))
        assert whole < found()


@pytest.mark.parametrize(("count", "anchors"), [(400, 25), (3000, 100)])
def test_an_anchor_has_sixteen_cells_or_more_and_a_step_takes_all_anchors(count, anchors):
    method = RegGeoNet(points=count, iterations=1, subset=100)
    assert method.parameterize(ball(count), seed=0).report["anchors"] == anchors


def test_a_patch_of_flattening_net_is_small_enough_to_assign(monkeypatch):
    method = FlatteningNet(iterations=2, subset=100)
    assert method.parameterize(ball(200), seed=0).report["patches"] == 1
    monkeypatch.setattr(flattening_net, "BLOCK", 8)
    result = method.parameterize(ball(400), seed=0)
    assert result.report["patches"] == 9
    assert result.report["collisions"] == 0


@pytest.mark.parametrize("kind", BOTH)
def test_time_ends_the_training(kind):
    method = kind(iterations=10**8, subset=100, time_budget=0.2)
    assert not method.deterministic
    assert dataclasses.replace(method, time_budget=None).deterministic
    assert 1 <= method.parameterize(ball(), seed=0).report["iterations"] < 10_000


@pytest.mark.parametrize("kind", BOTH)
def test_what_cannot_be_placed_is_refused_in_one_line(kind):
    with pytest.raises(InputError, match="at least 100"):
        kind().parameterize(PointCloud(ball(50).points), seed=0)
