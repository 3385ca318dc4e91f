import numpy as np
import torch

from parapoint.computed.anchored import AnchoredNetworks, Anchors, LocalFeatures
from parapoint.learned.networks import ACTIVATIONS

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
