import itertools

import numpy as np
import pytest
import torch

from parapoint.learned.networks import (
    ACTIVATIONS,
    Activation,
    Networks,
    OffsetStack,
    Stack,
    products,
)

HIDDEN = (64, 128, 512, 128)


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def networks(activation: str = "leaky_relu", hidden: tuple[int, ...] = HIDDEN) -> Networks:
    return Networks(hidden, 64, ACTIVATIONS[activation], generator())


def plain(stack: Stack, x: torch.Tensor) -> torch.Tensor:
    """A stack written with torch's own layers."""
    functions = {
        ACTIVATIONS["leaky_relu"]: lambda z: torch.nn.functional.leaky_relu(z, 0.01),
        ACTIVATIONS["squareplus"]: lambda z: (z + (z * z + 0.04).sqrt()) / 2,
    }
    for i, layer in enumerate(stack.layers):
        x = x @ layer[:-1] + layer[-1]
        if i + 1 < len(stack.layers):
            x = functions[stack.activation](x)
    return x


def parameter_count(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


def test_the_sub_networks_have_the_sizes_of_the_paper() -> None:
    def phi(i: int, o: int) -> int:
        sizes = (i, 64, 128, 512, 128, o)
        return sum(a * b + b for a, b in itertools.pairwise(sizes))

    assert phi(3, 2) == 256 + 8_320 + 66_048 + 65_664 + 258  # the five layers by hand
    net = networks()
    assert parameter_count(net.unwrap) == phi(3, 2)
    assert parameter_count(net.wrap) == phi(2, 3)
    assert parameter_count(net.stitch) == phi(3, 3)
    assert parameter_count(net.deform) == phi(2, 64) + phi(66, 2)
    assert parameter_count(net.cut) == phi(3, 64) + phi(67, 3)


def test_products_count_each_weight_once_for_a_point_and_each_tangent() -> None:
    # One stack of hidden size 1 and its two weights: all can be added up by hand.
    net = Networks((1,), 1, ACTIVATIONS["leaky_relu"], generator())
    cut, deform = (3 + 1) + (4 + 3), (2 + 1) + (3 + 2)
    unwrap, wrap, stitch = 3 + 2, 2 + 3, 3 + 3
    there, back = cut + unwrap, 3 * (wrap + stitch)
    assert products(net) == (there + back, deform + back + there)
    assert products(net, tangents=2) == (3 * there + back, deform + back + there)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_a_stack_is_what_torch_makes_of_its_layers(activation: str) -> None:
    stack = Stack(3, 2, (5, 7), ACTIVATIONS[activation], generator()).double()
    x = torch.randn(11, 3, generator=generator(), dtype=torch.float64)
    torch.testing.assert_close(stack(x[None])[0], plain(stack, x))


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_tangents_are_columns_of_the_jacobian(activation: str) -> None:
    stack = OffsetStack(3, 4, (5, 7), ACTIVATIONS[activation], generator()).double()
    x = torch.randn(6, 3, generator=generator(), dtype=torch.float64)
    axes = torch.eye(3, dtype=torch.float64)[:, None].expand(3, 6, 3)
    pushed = stack(torch.cat([x[None], axes]))[1:]
    for i in range(6):
        jacobian = torch.autograd.functional.jacobian(lambda p: stack(p[None, None])[0, 0], x[i])
        torch.testing.assert_close(pushed[:, i].T, jacobian)


@pytest.mark.parametrize("activation", ACTIVATIONS.values(), ids=ACTIVATIONS)
def test_gradients_are_those_of_plain_autograd(activation: Activation) -> None:
    # In float32 at the paper's sizes, by double backward: Jacobians as columns of autograd.grad.
    stack = Stack(2, 3, HIDDEN, activation, generator())
    x = torch.randn(40, 2, generator=generator())

    def objective(value: torch.Tensor, tangents: torch.Tensor) -> torch.Tensor:
        return value.square().sum() + tangents.square().mul(torch.arange(1.0, 4)).sum()

    axes = torch.eye(2)[:, None].expand(2, 40, 2)
    made = stack(torch.cat([x[None], axes]))
    ours = torch.autograd.grad(objective(made[0], made[1:]), [*stack.layers])
    at = x.clone().requires_grad_()
    value = plain(stack, at)
    rows = [torch.autograd.grad(value[:, c].sum(), at, create_graph=True)[0] for c in range(3)]
    theirs = torch.autograd.grad(
        objective(value, torch.stack(rows, dim=2).permute(1, 0, 2)), [*stack.layers]
    )
    for own, its in zip(ours, theirs, strict=True):
        torch.testing.assert_close(own, its, rtol=1e-3, atol=1e-4 * float(its.abs().max()))


@pytest.mark.parametrize("activation", ACTIVATIONS.values(), ids=ACTIVATIONS)
def test_the_gradient_of_a_function_of_values_and_tangents(activation: Activation) -> None:
    stack = Stack(2, 3, (5, 4), activation, generator()).double()
    x = torch.randn(3, 7, 2, generator=generator(), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x, *_: stack(x), (x, *stack.layers), eps=1e-7, atol=1e-5)


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_nothing_leaves_the_device_of_the_points(activation: str) -> None:
    # "meta" stands for any device but the CPU: an operation across the two raises.
    net = networks(activation).to("meta")
    cycle = net(torch.empty(3, 9, 3, device="meta"), torch.empty(4, 2, device="meta"))
    outputs = [output for branch in cycle for output in branch]
    assert {output.device.type for output in outputs} == {"meta"}
    torch.stack([output.sum() for output in outputs]).sum().backward()
    assert {p.grad.device.type for p in net.parameters()} == {"meta"}


@pytest.mark.parametrize("activation", ACTIVATIONS.values(), ids=ACTIVATIONS)
def test_blocks_are_the_same_function(
    activation: Activation, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = Stack(2, 3, (5, 4), activation, generator()).double()
    x = torch.randn(3, 7, 2, generator=generator(), dtype=torch.float64, requires_grad=True)
    results = []
    for rows in (100, 6):  # one block, and four of two points with their tangents
        monkeypatch.setattr("parapoint.learned.networks.BLOCK", rows)
        made = stack(x)
        results.append([made, *torch.autograd.grad(made.square().sum(), [x, *stack.layers])])
    torch.testing.assert_close(*results)


def test_far_from_zero_the_smooth_activation_is_finite() -> None:
    z = torch.tensor([-1e6, -1e3, 0.0, 1e3, 1e6])[None, :, None].repeat(2, 1, 1)
    z[1] = 1
    ACTIVATIONS["squareplus"].push_(z)
    gradient = torch.ones_like(z)
    ACTIVATIONS["squareplus"].pull_(gradient, z)
    expected = torch.tensor([[0, 0, 0.1, 1e3, 1e6], [0, 0, 0.5, 1, 1]])[:, :, None]
    torch.testing.assert_close(z, expected, rtol=0, atol=1e-3)
    # σ'' at 0 is 1 / (2 · width), and the tangent there is 1.
    expected = torch.tensor([[0, 0, 3, 1, 1], [0, 0, 0.5, 1, 1]])[:, :, None]
    torch.testing.assert_close(gradient, expected, rtol=0, atol=1e-3)


def test_no_points_are_mapped_to_none() -> None:
    with torch.no_grad():
        assert networks().parameterization(torch.zeros(0, 3)).shape == (0, 2)


def test_both_branches_are_the_compositions_of_the_paper() -> None:
    net = networks()
    points = torch.randn(9, 3, generator=generator())
    grid = torch.rand(4, 2, generator=generator())
    there, back = net(points[None], grid)
    torch.testing.assert_close(there.cut, net.cut(points[None])[0])
    torch.testing.assert_close(there.uv, net.unwrap(there.cut[None])[0])
    torch.testing.assert_close(there.uv, net.parameterization(points))
    torch.testing.assert_close(there.cut_cycle, net.wrap(there.uv[None])[0])
    torch.testing.assert_close(there.points_cycle, net.stitch(there.cut_cycle[None])[0])
    torch.testing.assert_close(back.uv, net.deform(grid[None])[0])
    torch.testing.assert_close(back.cut, net.wrap(back.uv[None])[0])
    torch.testing.assert_close(back.points, net.surface(back.uv))
    torch.testing.assert_close(back.cut_cycle, net.cut(back.points[None])[0])
    torch.testing.assert_close(back.uv_cycle, net.unwrap(back.cut_cycle[None])[0])
    jacobian = torch.autograd.functional.jacobian(lambda q: net.surface(q[None])[0], there.uv[5])
    torch.testing.assert_close(there.tangents[:, 5].T, jacobian, rtol=1e-4, atol=1e-6)
    jacobian = torch.autograd.functional.jacobian(lambda q: net.surface(q[None])[0], back.uv[2])
    torch.testing.assert_close(back.tangents[:, 2].T, jacobian, rtol=1e-4, atol=1e-6)


def test_a_branch_can_be_left_out() -> None:
    net = networks(hidden=(4,))
    points, grid = torch.zeros(1, 5, 3), torch.zeros(3, 2)
    both, there, back = net(points, grid), net(points, None), net(None, grid)
    assert there.grid is None
    assert back.point is None
    torch.testing.assert_close(there.point.points_cycle, both.point.points_cycle)
    torch.testing.assert_close(back.grid.uv_cycle, both.grid.uv_cycle)


def test_weights_come_from_the_generator_alone() -> None:
    before = torch.get_rng_state()
    first, second = networks(), networks()
    assert torch.equal(torch.get_rng_state(), before)
    for a, b in zip(first.parameters(), second.parameters(), strict=True):
        assert torch.equal(a, b)
        assert float(a.detach().abs().max()) <= 1 / np.sqrt(2)


def test_tangents_of_the_surface_are_unfolded() -> None:
    net = networks("squareplus", hidden=(8,)).double()
    points = torch.randn(5, 3, generator=generator(), dtype=torch.float64)
    axes = torch.eye(3, dtype=torch.float64)[:2, None].expand(2, 5, 3)
    there, _ = net(torch.cat([points[None], axes]), None)
    jacobian = torch.autograd.functional.jacobian(
        lambda p: net.parameterization(p[None])[0], points[3]
    )
    torch.testing.assert_close(there.unfolding[:, 3].T, jacobian[:, :2])


def test_weights_start_uniform_within_one_over_the_root_of_the_inputs() -> None:
    # 1 / √100 into the first layer, 1 / √4 into the second; of 404 and 100 draws the largest is
    # within a tenth of the bound but for a chance of 0.9^100 < 1e-4.
    first, second = Stack(100, 20, (4,), ACTIVATIONS["leaky_relu"], generator()).layers
    assert 0.09 < float(first.detach().abs().max()) <= 0.1
    assert 0.45 < float(second.detach().abs().max()) <= 0.5


def test_an_offset_of_nothing_leaves_points_and_tangents() -> None:
    # With all weights 0 the offset is 0, and so is its derivative.
    stack = OffsetStack(3, 4, (5,), ACTIVATIONS["squareplus"], generator())
    for layer in stack.parameters():
        torch.nn.init.zeros_(layer)
    x = torch.randn(3, 7, 3, generator=generator())
    torch.testing.assert_close(stack(x), x)
