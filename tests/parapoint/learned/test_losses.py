import math

import numpy as np
import pytest
import torch
from torch import Tensor, tensor

from parapoint.learned import losses


def tangents(J: list[list[float]]) -> Tensor:
    """(2, 1, 3) columns of one 3x2 Jacobian."""
    return tensor(J).T[:, None].contiguous()


def rotated(J: Tensor, seed: int) -> Tensor:
    """(2, N, 3) tangents of R J S for random rotations R of space and S of the plane."""
    rng = np.random.default_rng(seed)
    R = torch.as_tensor(np.linalg.qr(rng.normal(size=(3, 3)))[0], dtype=J.dtype)
    a = float(rng.uniform(0, 2 * math.pi))
    S = tensor([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]], dtype=J.dtype)
    return torch.einsum("ij,knj,kl->lni", R, J, S).contiguous()


def test_nearest_is_exact_and_in_order() -> None:
    points = tensor([[0.0, 0.0], [1.0, 0.0], [3.0, 0.0], [7.0, 0.0]])
    found = losses.nearest(tensor([[2.9, 0.0]]), points, 3)
    assert found.tolist() == [[2, 1, 0]]
    assert losses.neighbours(points, 1).tolist() == [[1], [0], [1], [2]]


def test_points_that_are_not_finite_are_told() -> None:
    with pytest.raises(losses.NotFiniteError):
        losses.neighbours(tensor([[0.0, 0.0], [math.nan, 0.0], [1.0, 0.0]]), 1)


def test_unwrap_loss_by_hand() -> None:
    # Four points: L = 4 and N = 4, so epsilon = 0.5 * 4 / 2 = 1. Only the pair at distance 0.25 is
    # closer, and each of the two sees the other: (0.75 + 0.75) / 4.
    uv = tensor([[0.0, 0.0], [0.25, 0.0], [4.0, 0.0], [0.0, 4.0]])
    assert float(losses.unwrap_loss(uv, 2, 0.5)) == pytest.approx(0.375, rel=1e-5)


def test_unwrap_loss_pushes_apart() -> None:
    uv = tensor([[0.0, 0.0], [0.25, 0.0], [4.0, 0.0], [0.0, 4.0]], requires_grad=True)
    losses.unwrap_loss(uv, 2, 0.5).backward()
    assert uv.grad is not None
    assert uv.grad[0, 0] > 0 > uv.grad[1, 0]  # descent moves the left point left


def test_wrap_loss_is_the_larger_directional_mean() -> None:
    # From made to given: 0 and 1, mean 0.5. From given to made: 0, 1 and 4, mean 5 / 3.
    made = tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    given = tensor([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 5.0]])
    assert float(losses.wrap_loss(made, given)) == pytest.approx(5 / 3, rel=1e-5)
    assert float(losses.wrap_loss(given, made)) == pytest.approx(5 / 3, rel=1e-5)


def test_cycle_loss_is_a_mean_of_l1_distances() -> None:
    first, second = tensor([[0.0, 0.0], [1.0, 1.0]]), tensor([[1.0, -2.0], [1.0, 1.5]])
    assert float(losses.cycle_loss(first, second)) == pytest.approx((3 + 0.5) / 2)


@pytest.mark.parametrize("seed", range(5))
def test_singular_values_do_not_depend_on_the_frame(seed: int) -> None:
    J = rotated(tangents([[3.0, 0.0], [0.0, 2.0], [0.0, 0.0]]), seed)
    first, second = losses.singular_values(J)
    np.testing.assert_allclose([float(first), float(second)], [3, 2], rtol=1e-5)
    first, second = losses.gram_eigenvalues(J)
    np.testing.assert_allclose([float(first), float(second)], [9, 4], rtol=1e-5)


def test_singular_values_are_those_of_the_matrix() -> None:
    J = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    expected = torch.linalg.svdvals(J.permute(1, 2, 0))
    found = torch.stack(losses.singular_values(J), 1)
    # The root's epsilon, 1e-12, against values of order 1.
    torch.testing.assert_close(found, expected, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("eigenvalues", losses.EIGENVALUES.values(), ids=losses.EIGENVALUES)
def test_the_gradient_is_finite_at_a_conformal_map_and_at_a_collapsed_one(eigenvalues) -> None:
    for scale in (1.0, 0.0):
        J = (scale * tangents([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])).requires_grad_()
        losses.conformal_loss(*eigenvalues(J)).backward()
        assert J.grad is not None
        assert J.grad.isfinite().all()


def test_conformal_and_isometric_loss_by_hand() -> None:
    first, second = tensor([2.0, 1.0]), tensor([2.0, 0.5])
    assert float(losses.conformal_loss(first, second)) == pytest.approx(0.25)
    assert float(losses.isometric_loss(first, second)) == pytest.approx((1 + 1 + 0 + 0.5) / 2)


def test_anti_flip_loss_counts_neighbours_that_turn_away() -> None:
    # Four points in a row, the last one's normal reversed; K = 1. The third and the fourth point
    # are each other's nearest: cos = -1 for both, so (1 + 1) / 4.
    points = tensor([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0], [4.0, 0, 0]])
    u = tensor([[1.0, 0, 0]]).repeat(4, 1)
    v = tensor([[0.0, 1, 0]]).repeat(4, 1)
    v[3] *= -1
    J = torch.stack([u, v])
    assert float(losses.anti_flip_loss(points, J, 1, math.pi / 2)) == pytest.approx(0.5)
    # With T = 0 every deviation counts: 1 - cos = 2 for the same two.
    assert float(losses.anti_flip_loss(points, J, 1, 0.0)) == pytest.approx(1.0)
    # Normals at a right angle are just allowed.
    v[3] = tensor([0.0, 0.0, 1.0])
    at_right_angle = losses.anti_flip_loss(points, torch.stack([u, v]), 1, math.pi / 2)
    assert float(at_right_angle) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("J", "expected"),
    [
        ([[2.0, 0.0], [0.0, 2.0]], 0.0),  # a similarity
        ([[2.0, 0.0], [0.0, -2.0]], 2.0),  # a mirror
        ([[2.0, 0.0], [0.0, 0.0]], 1.0),  # collapsed
        ([[2.0, 0.0], [0.0, 1.0]], 0.2),  # (2 - 1)^2 / (2^2 + 1^2)
    ],
)
def test_unfolding_loss_by_hand(J: list[list[float]], expected: float) -> None:
    images = tensor(J)[:, None].repeat(1, 3, 1)
    assert float(losses.unfolding_loss(images)) == pytest.approx(expected, abs=1e-6)


def test_unwrap_loss_holds_the_box_fixed() -> None:
    # As above: the pair at distance 0.25 is in each other's sum, 2 (1 − d) / 4 in all, so its two
    # points have slopes ±1/2 along x. The other two, which span the box, are in no sum: were L(Q)
    # not held fixed, a smaller box would lower the loss, and they would be drawn in.
    uv = tensor([[0.0, 0.0], [0.25, 0.0], [4.0, 0.0], [0.0, 4.0]], requires_grad=True)
    losses.unwrap_loss(uv, 2, 0.5).backward()
    expected = tensor([[0.5, 0.0], [-0.5, 0.0], [0.0, 0.0], [0.0, 0.0]])
    assert uv.grad is not None
    torch.testing.assert_close(uv.grad, expected)


def test_unwrap_loss_measures_the_longer_side_of_the_box() -> None:
    # Four points in a box of 4 by 1, so L = 4 and epsilon is 1 as in the first example. The pairs
    # (0, 1), (0, 3) and (1, 3) are 0.25, 1 and √1.0625 apart, so the same 0.375 is left.
    uv = tensor([[0.0, 0.0], [0.25, 0.0], [4.0, 0.0], [0.0, 1.0]])
    assert float(losses.unwrap_loss(uv, 2, 0.5)) == pytest.approx(0.375, rel=1e-5)


def test_anti_flip_loss_adds_up_over_the_neighbours_of_a_point() -> None:
    # Three points, the last one's normal reversed, K = 2: each sees the two others. The first two
    # see one that turns away, cos = −1, the last one sees two: (1 + 1 + 2) / 3.
    points = tensor([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0]])
    v = tensor([[0.0, 1, 0], [0.0, 1, 0], [0.0, -1, 0]])
    J = torch.stack([tensor([[1.0, 0, 0]]).repeat(3, 1), v])
    assert float(losses.anti_flip_loss(points, J, 2, math.pi / 2)) == pytest.approx(4 / 3)


@pytest.mark.parametrize("eigenvalues", losses.EIGENVALUES.values(), ids=losses.EIGENVALUES)
@pytest.mark.parametrize("scale", [1e-5, 1e-3, 1e3])
def test_values_and_gradients_of_a_map_scale_with_it(eigenvalues, scale: float) -> None:
    """A map that starts a thousand times too small is judged as it would be at its size."""
    at_one = torch.randn(2, 50, 3, generator=torch.Generator().manual_seed(0)).requires_grad_()
    scaled = (scale * at_one.detach()).requires_grad_()
    power = 2 if eigenvalues is losses.gram_eigenvalues else 1
    for value, own in zip(eigenvalues(at_one), eigenvalues(scaled), strict=True):
        torch.testing.assert_close(own / scale**power, value, rtol=1e-4, atol=1e-5)
    losses.conformal_loss(*eigenvalues(at_one)).backward()
    losses.conformal_loss(*eigenvalues(scaled)).backward()
    torch.testing.assert_close(
        scaled.grad / scale ** (power - 1), at_one.grad, rtol=1e-3, atol=1e-6
    )


@pytest.mark.parametrize(("log", "counted"), [(1.0, 1.0), (3.0, 3.0), (8.0, 3.0), (-8.0, -3.0)])
def test_areas_count_by_their_logarithms_up_to_three(log: float, counted: float) -> None:
    # Four conformal images, three of one size and one of e^log times the area: no angles change.
    side = torch.tensor([1.0, 1.0, 1.0, math.exp(log / 2)])
    images = torch.stack([torch.stack([side, 0 * side], 1), torch.stack([0 * side, side], 1)])
    assert float(losses.unfolding_loss(images)) == pytest.approx(0, abs=1e-6)
    assert float(losses.unfolding_loss(images, 0.5)) == pytest.approx(counted**2 / 8, rel=1e-4)
