import numpy as np
import torch

from parapoint.anchored import AnchoredNetworks, Anchors, LocalFeatures, _shepard_weights
from parapoint.networks import ACTIVATIONS

JACOBIAN = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0], [3.0, 0.0, 1.0]])


def affine(points: np.ndarray) -> Anchors:
    return Anchors(points, points @ JACOBIAN.T + 1, np.repeat(JACOBIAN[None], len(points), axis=0))


def layer(anchors: Anchors) -> LocalFeatures:
    made = LocalFeatures(len(anchors.points))
    made.hold(anchors)
    return made


def random_points(count: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (count, 3))


def test_values_are_kept_at_the_anchors_and_an_affine_map_everywhere() -> None:
    anchors = affine(random_points(200))
    x = np.concatenate([anchors.points, random_points(50, seed=1)])
    made = layer(anchors)(torch.from_numpy(x)[None].float())[0].numpy()
    np.testing.assert_allclose(made, affine(x).values, atol=2e-6)


def test_tangents_are_pushed_forward() -> None:
    x = torch.from_numpy(random_points(20, seed=1)).float()
    tangents = torch.eye(3)[:, None].expand(3, 20, 3)
    made = layer(affine(random_points(200)))(torch.cat([x[None], tangents]))[1:]
    expected = torch.from_numpy(JACOBIAN).float().T[:, None].expand(3, 20, 3)
    torch.testing.assert_close(made, expected)


def test_nothing_is_blended_across_a_seam() -> None:
    # Points left and right of x = 0 are moved apart by 50.
    points = random_points(400)
    side = np.sign(points[:, :1])
    identity = np.repeat(np.eye(3)[None], len(points), axis=0)
    made = layer(Anchors(points, points + [50.0, 0, 0] * side, identity))
    x = random_points(300, seed=1)
    moved = made(torch.from_numpy(x)[None].float())[0].numpy() - x
    np.testing.assert_allclose(np.abs(moved[:, 0]), 50, atol=1e-4)


def test_points_on_coinciding_anchors_have_finite_values_and_gradients() -> None:
    anchors = affine(np.repeat(random_points(10), 20, axis=0))
    x = torch.from_numpy(anchors.points[:40])[None].float().requires_grad_()
    made = layer(anchors)(x)
    made.sum().backward()
    assert torch.isfinite(made).all()
    assert torch.isfinite(x.grad).all()


def test_deform_alone_has_parameters() -> None:
    generator = torch.Generator().manual_seed(0)
    net = AnchoredNetworks(50, (8,), 4, ACTIVATIONS["squareplus"], generator)
    assert {name.split(".")[0] for name, _ in net.named_parameters()} == {"deform"}


def grid(side: int) -> np.ndarray:
    """(side³, 3) points at distance 1 around the origin."""
    return np.stack(np.meshgrid(*[np.arange(side) - (side - 1) / 2] * 3), axis=3).reshape(-1, 3)


def test_a_jump_of_three_times_what_the_derivatives_allow_is_a_seam() -> None:
    # Neighbours across x = 0 are d ≤ 2 apart, and their values d + 9, more than 3 d, as what is
    # right of it is shifted by 9. So at x = ±0.1 the shift is that of the point's own side alone.
    # A shift of 1 leaves d + 1 ≤ 3 d: it is no jump, and the blend is of both sides.
    x = torch.tensor([[[0.1, 0.2, 0.3], [-0.1, 0.2, 0.3]]])
    points = grid(6)
    identity = np.repeat(np.eye(3)[None], len(points), axis=0)
    for shift, expected in ((9.0, [9.0, 0.0]), (1.0, None)):
        moved = points + [shift, 0, 0] * (points[:, :1] > 0)
        made = (layer(Anchors(points, moved, identity))(x) - x)[0, :, 0].numpy()
        if expected is None:
            assert 0.1 < made[1] < 0.5 < made[0] < 0.9
        else:
            np.testing.assert_allclose(made, expected, atol=1e-5)


def test_anchors_are_weighted_by_the_square_of_what_their_inverse_distance_exceeds() -> None:
    # Distances 1 and 2, R = 4: (1 − 1/4)² and (1/2 − 1/4)² are as 9 to 1. The last one that there
    # is may be missing; R² is then 1.5 · 4.
    squared = torch.tensor([[1.0, 4.0, 16.0], [1.0, 4.0, torch.inf]])
    r = 6**0.5
    near, far = (1 - 1 / r) ** 2, (1 / 2 - 1 / r) ** 2
    expected = torch.tensor([[0.9, 0.1], [near / (near + far), far / (near + far)]])
    torch.testing.assert_close(_shepard_weights(squared), expected)
