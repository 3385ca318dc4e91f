"""The five sub-networks and the two cycle branches they are assembled into.

Every network maps tensors of shape (1 + T, N, C): entry 0 holds N points of C channels, entries
1 to T hold tangents at these points, which are pushed forward beside them (forward-mode
derivatives). Points and tangents go through one matrix product: a linear layer maps a tangent t to
W t, an activation multiplies it by its slope at the point. So a Jacobian costs as much as its
columns, and the loss that is put on it needs no second backward pass.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import torch
from torch import Tensor, nn


class Activation(Protocol):
    """A nonlinearity, applied to points and tangents in place."""

    def push_(self, z: Tensor) -> None:
        """(1 + T, N, C) pre-activations, overwritten: points by σ(z), tangents t by σ'(z) t."""
        ...

    def pull_(self, gradient: Tensor, h: Tensor) -> None:
        """(1 + T, N, C) gradient at what `push_` left in `h`, overwritten by the one at z."""
        ...


@dataclass(frozen=True)
class LeakyReLU:
    """max(z, slope z), as the paper has it (slope 0.01); piecewise linear, so σ'' = 0."""

    slope: float = 0.01

    def push_(self, z: Tensor) -> None:
        """See `Activation`."""
        nn.functional.leaky_relu_(z[0], self.slope)
        if len(z) > 1:
            self.pull_(z[1:], z[:1])

    def pull_(self, gradient: Tensor, h: Tensor) -> None:
        """See `Activation`. The sign of σ(z) is the sign of z, so the slope is known from h."""
        torch.ops.aten.leaky_relu_backward.grad_input(
            gradient, h[:1].expand_as(gradient), self.slope, True, grad_input=gradient
        )


@dataclass(frozen=True)
class Squareplus:
    """(z + √(z² + width²)) / 2 (Barron 2021): smooth, so that Jacobians vary with the point.

    Much like a softplus, with a square root in place of an exponential and a logarithm, which were
    a tenth of a step.
    """

    width: float = 0.2

    def push_(self, z: Tensor) -> None:
        """See `Activation`. With r = √(z² + width²) is σ = (z + r) / 2 and σ' = σ / r."""
        root = torch.addcmul(z.new_tensor(self.width**2), z[0], z[0]).sqrt_()
        z[0].lerp_(root, 0.5)
        if len(z) > 1:
            z[1:] *= torch.div(z[0], root, out=root)

    def pull_(self, gradient: Tensor, h: Tensor) -> None:
        """See `Activation`. With q = 4 σ² / width² is 1 - σ' = 1 / (1 + q).

        And σ'' / σ' = 8 σ (1 - σ')² / width².
        """
        scale = 4 / self.width**2
        rest = torch.addcmul(h.new_tensor(1.0), h[0], h[0], value=scale).reciprocal_()
        if len(h) > 1:
            bend = gradient[1] * h[1]
            for of_tangent, tangent in zip(gradient[2:], h[2:], strict=True):
                bend.addcmul_(of_tangent, tangent)
        gradient.addcmul_(gradient, rest, value=-1)
        if len(h) > 1:
            gradient[0].addcmul_(bend.mul_(rest).mul_(rest), h[0], value=2 * scale)


ACTIVATIONS: dict[str, Activation] = {"leaky_relu": LeakyReLU(), "squareplus": Squareplus()}
"""What `Preset.activation` may name."""


NARROW = 32
"""Products with fewer columns are taken narrow side first."""
ROOM = 16
"""Channels that a row of activations has beyond its own: the first is the homogeneous coordinate,
and this number keeps the rows aligned to 64 bytes."""
BLOCK = 4_608
"""Most rows, of points and tangents, that go through a stack together on a CPU: with 12,000 a step
takes 7 % longer, as what a layer made has left the cache before the next one reads it."""


def _product(left: Tensor, right: Tensor) -> Tensor:
    """The product left @ right, narrow side first: 5 times as fast on a CPU at 3 columns."""
    return (right.t().contiguous() @ left.t()).t() if right.shape[1] < NARROW else left @ right


def _homogeneous(channels: int, is_point: Tensor) -> Tensor:
    """(count, points, channels + 1) to be filled; `is_point` (count, points) is in the last."""
    count, points = is_point.shape
    rows = is_point.new_empty(count, points, channels + ROOM)[:, :, : channels + 1]
    rows.select(2, channels).copy_(is_point)
    return rows


class _StackFunction(torch.autograd.Function):
    """A stack of linear layers with its backward pass written out: elementwise work in place.

    Points and tangents are in homogeneous coordinates, so a layer [W; b] is one product, which adds
    b to points alone, and its gradient is another: no pass over the activations is left but the
    nonlinearity's. With a layer's outputs in the columns, all three products of a layer take and
    give rows as they lie in memory.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, activation: Activation, *layers: Tensor) -> Tensor:
        ctx.activation, keeps = activation, any(ctx.needs_input_grad)
        count, points, channels = x.shape
        is_point = x.new_zeros(count, points)
        is_point[0] = 1
        h = _homogeneous(channels, is_point)
        h[:, :, :-1] = x
        inputs: list[Tensor] = []
        for layer in layers[:-1]:
            if keeps:
                inputs.append(h)
            made = _homogeneous(layer.shape[1], is_point)
            z = made[:, :, :-1]
            torch.mm(h.flatten(0, 1), layer, out=z.flatten(0, 1))
            activation.push_(z)
            h = made
        ctx.save_for_backward(*layers, *inputs, h)
        return _product(h.flatten(0, 1), layers[-1]).reshape(count, points, layers[-1].shape[1])

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, output_gradient: Tensor) -> tuple[Tensor | None, ...]:
        count = len(ctx.saved_tensors) // 2
        layers, inputs = ctx.saved_tensors[:count], ctx.saved_tensors[count:]
        of_layers: list[Tensor] = []
        gradient = output_gradient.flatten(0, 1)
        for layer, h in zip(reversed(layers), reversed(inputs), strict=True):
            of_layers.append(_product(h.flatten(0, 1).t(), gradient).contiguous())
            is_first = len(of_layers) == count
            if is_first and not ctx.needs_input_grad[0]:
                return None, None, *reversed(of_layers)
            gradient = gradient @ layer[:-1].t()
            if not is_first:
                made = h[:, :, :-1]
                ctx.activation.pull_(gradient.view(made.shape), made)
        of_input = gradient.reshape(inputs[0][:, :, :-1].shape)
        return of_input, None, *reversed(of_layers)


class Stack(nn.Module):
    """Φ(inputs → outputs): linear layers, an activation between them, none after the last.

    A layer is one parameter [W; b] (inputs + 1, outputs), which starts uniform within
    ±1 / √(inputs), torch's own default.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        hidden: tuple[int, ...],
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.layers = nn.ParameterList()
        for before, after in itertools.pairwise((inputs, *hidden, outputs)):
            uniform = 2 * torch.rand(after, before + 1, generator=generator) - 1
            self.layers.append(nn.Parameter((uniform / before**0.5).t().contiguous()))
        self.activation = activation

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, inputs) points and tangents → (1 + T, N, outputs).

        Without gradients no layer's input is kept longer than the layer takes.
        """
        layers = list(self.layers)
        if not torch.is_grad_enabled():
            layers = [layer.detach() for layer in layers]
        points = BLOCK // len(x) if x.device.type == "cpu" else max(1, x.shape[1])
        parts = [
            _StackFunction.apply(part, self.activation, *layers)  # type: ignore[no-untyped-call]
            for part in torch.split(x, points, dim=1)
        ]
        return torch.cat(parts, dim=1)


class OffsetStack(nn.Module):
    """x + Φ([Φ(x); x]): an embedding beside the point itself, then an offset of the point."""

    def __init__(
        self,
        channels: int,
        embedding: int,
        hidden: tuple[int, ...],
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.embed = Stack(channels, embedding, hidden, activation, generator)
        self.offset = Stack(embedding + channels, channels, hidden, activation, generator)

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, channels) points and tangents → the same shape."""
        offset: Tensor = self.offset(torch.cat([self.embed(x), x], dim=2))
        return x + offset


class PointBranch(NamedTuple):
    """3D→2D→3D: the cloud P, opened, flattened and brought back.

    Attributes:
        points: P (N, 3).
        cut: S = Cut(P) (N, 3).
        uv: Q = Unwrap(S) (N, 2), the parameterization.
        cut_cycle: Wrap(Q) (N, 3).
        points_cycle: Stitch(Wrap(Q)) = f(Q) (N, 3).
        tangents: f_u and f_v at Q (2, N, 3).
        unfolding: images in the plane of two tangent vectors of the surface at P (2, N, 2), or
            (0, N, 2) where none were given.
    """

    points: Tensor
    cut: Tensor
    uv: Tensor
    cut_cycle: Tensor
    points_cycle: Tensor
    tangents: Tensor
    unfolding: Tensor


class GridBranch(NamedTuple):
    """2D→3D→2D: the deformed lattice, wrapped, stitched and brought back.

    Attributes:
        uv: Q̂ = Deform(G) (M, 2).
        cut: Ŝ = Wrap(Q̂) (M, 3).
        points: P̂ = Stitch(Ŝ) = g(Q̂) (M, 3).
        tangents: g_u and g_v at Q̂ (2, M, 3).
        cut_cycle: Cut(P̂) (M, 3).
        uv_cycle: Unwrap(Cut(P̂)) (M, 2).
    """

    uv: Tensor
    cut: Tensor
    points: Tensor
    tangents: Tensor
    cut_cycle: Tensor
    uv_cycle: Tensor


class Cycle(NamedTuple):
    """Both branches; None where one is left out (the paper's ablation)."""

    point: PointBranch | None
    grid: GridBranch | None


class SurfaceNetworks(nn.Module):
    """Networks made of stacks that map a surface to the plane; what a trainer can train."""

    def parameterization(self, points: Tensor) -> Tensor:
        """(N, 3) points of the surface → (N, 2) points of the plane."""
        raise NotImplementedError

    def surface(self, uv: Tensor) -> Tensor:
        """(N, 2) points of the plane → (N, 3) points of the surface."""
        raise NotImplementedError


class SubNetworks(SurfaceNetworks):
    """Deform, Cut, Stitch, Wrap and Unwrap, whatever is in them, and the maps made of them.

    Each maps (1 + T, N, C) points and tangents.
    """

    deform: nn.Module
    cut: nn.Module
    stitch: nn.Module
    wrap: nn.Module
    unwrap: nn.Module

    def forward(self, points: Tensor | None, grid: Tensor | None, *, slopes: bool = True) -> Cycle:
        """Both branches at points P and lattice G (M, 2); None leaves a branch out.

        Both go through Wrap and Stitch, where the tangents are, together.

        Args:
            points: (1, N, 3), or (3, N, 3) with two tangent vectors of the surface at each point.
            grid: (M, 2).
            slopes: whether f_u, f_v and g_u, g_v are wanted; without them `tangents` are (0, N, 3).
        """
        wrapped = []
        if points is not None:
            cut = self.cut(points)
            flat = self.unwrap(cut)
            wrapped.append(flat[0])
        if grid is not None:
            wrapped.append(self.deform(grid[None])[0])
        uv = torch.cat(wrapped)
        axes = torch.eye(2, dtype=uv.dtype, device=uv.device)[:, None].expand(2, len(uv), 2)
        opened = self.wrap(torch.cat([uv[None], axes]) if slopes else uv[None])
        closed = self.stitch(opened)
        count = 0 if points is None else points.shape[1]
        point_branch = grid_branch = None
        if points is not None:
            point_branch = PointBranch(
                points=points[0],
                cut=cut[0],
                uv=uv[:count],
                cut_cycle=opened[0, :count],
                points_cycle=closed[0, :count],
                tangents=closed[1:, :count],
                unfolding=flat[1:],
            )
        if grid is not None:
            on_shape = closed[0, count:]
            reopened = self.cut(on_shape[None])
            flattened = self.unwrap(reopened)[0]
            grid_branch = GridBranch(
                uv=uv[count:],
                cut=opened[0, count:],
                points=on_shape,
                tangents=closed[1:, count:],
                cut_cycle=reopened[0],
                uv_cycle=flattened,
            )
        return Cycle(point_branch, grid_branch)

    def parameterization(self, points: Tensor) -> Tensor:
        """Q = Unwrap(Cut(P)): (N, 3) → (N, 2)."""
        uv: Tensor = self.unwrap(self.cut(points[None]))[0]
        return uv

    def surface(self, uv: Tensor) -> Tensor:
        """f(Q) = Stitch(Wrap(Q)): (N, 2) → (N, 3)."""
        points: Tensor = self.stitch(self.wrap(uv[None]))[0]
        return points


class Networks(SubNetworks):
    """The sub-networks of the paper (section 3.2)."""

    def __init__(
        self,
        hidden: tuple[int, ...],
        embedding: int,
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.deform = OffsetStack(2, embedding, hidden, activation, generator)
        self.cut = OffsetStack(3, embedding, hidden, activation, generator)
        self.stitch = Stack(3, 3, hidden, activation, generator)
        self.wrap = Stack(2, 3, hidden, activation, generator)
        self.unwrap = Stack(3, 2, hidden, activation, generator)


def cost(module: nn.Module) -> int:
    """Multiply-adds of the linear layers for one point, forward alone, biases left out."""
    stacks = [part for part in module.modules() if isinstance(part, Stack)]
    return sum((len(w) - 1) * w.shape[1] for stack in stacks for w in stack.layers)


def products(networks: SubNetworks, tangents: int = 0) -> tuple[int, int]:
    """Multiply-adds for one point of the point branch and one of the grid branch, forward alone.

    A tangent counts as one more point: two go through Wrap and Stitch, and `tangents` of the
    surface through Cut and Unwrap in the point branch. A backward pass does twice the work of the
    forward one.
    """
    there = cost(networks.cut) + cost(networks.unwrap)
    back = 3 * (cost(networks.wrap) + cost(networks.stitch))
    return (1 + tangents) * there + back, cost(networks.deform) + back + there
