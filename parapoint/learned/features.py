"""The five networks of the preset `learned`: smooth, with Fourier features and a Cut that can jump.

The paper's networks are continuous, so they can only approach the jump that a seam is, and smear a
band of faces beside it. Here Cut's embedding, which the paper's has too, holds gates: numbers that
one small network makes and that change their sign, at once, where the surface is opened.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from parapoint.learned.networks import Activation, OffsetStack, Stack, SubNetworks

OCTAVES = 4.0
"""Octaves of the frequencies of a feature, from 1 radian per radius of the surface upwards."""
SHARPNESS = 6.0
"""Factor on a gate's argument inside the tanh: a value of 0.5 leaves 0.5 % to a full jump."""
FLOOR = 0.1
"""What `reach` has to exceed: otherwise a gate's small errors far from its seam, with a sign that
jumps there, too, tear the map."""
GATE_HIDDEN = (96, 96)
"""Hidden layer sizes of the network that makes the gates."""


class Features(nn.Module):
    """x → [x, sin(Bx), cos(Bx)], the columns of B random (Tancik et al. 2020, "Fourier features").

    A feature's amplitude falls with the root of its frequency, so that the smooth parts of a map
    are learned first.

    Args:
        channels: of x.
        count: columns of B.
        generator: of their directions, uniform, and lengths, log-uniform over OCTAVES.
    """

    frequencies: Tensor
    amplitudes: Tensor

    def __init__(self, channels: int, count: int, generator: torch.Generator) -> None:
        super().__init__()
        directions = nn.functional.normalize(
            torch.randn(channels, count, generator=generator), dim=0
        )
        length = 2 ** (OCTAVES * torch.rand(count, generator=generator))
        self.register_buffer("frequencies", directions * length)
        self.register_buffer("amplitudes", length**-0.5)
        self.channels = channels + 2 * count

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, channels) points and tangents → (1 + T, N, channels + 2 count)."""
        z = x @ self.frequencies
        sine, cosine = z[:1].sin() * self.amplitudes, z[:1].cos() * self.amplitudes
        waves = torch.cat([sine, cosine], 2)
        slopes = torch.cat([cosine, -sine], 2) * torch.cat([z[1:], z[1:]], 2)
        return torch.cat([x, torch.cat([waves, slopes])], 2)


class FeatureStack(nn.Module):
    """Φ(features(x))."""

    def __init__(
        self,
        inputs: int,
        outputs: int,
        features: int,
        hidden: tuple[int, ...],
        *,
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.features = Features(inputs, features, generator)
        self.stack = Stack(self.features.channels, outputs, hidden, activation, generator)

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, inputs) points and tangents → (1 + T, N, outputs)."""
        made: Tensor = self.stack(self.features(x))
        return made


class GatedCut(nn.Module):
    """x + Φ([gates(x); features(x)]).

    A gate is tanh(SHARPNESS · side(x)) · max(0, reach(x) − FLOOR). One network makes `side`, whose
    sign says on which side of a seam x lies, and `reach`, which falls to 0 away from it and towards
    its ends. The slope of the tanh, which is nearly 0 or nearly infinite, is left out of tangents.
    """

    def __init__(
        self,
        gates: int,
        features: int,
        hidden: tuple[int, ...],
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.features = Features(3, features, generator)
        width = self.features.channels
        self.gate = Stack(width, 2 * gates, GATE_HIDDEN, activation, generator)
        self.offset = Stack(width + gates, 3, hidden, activation, generator)

    def sides(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """`side` and `reach` (N, gates) at points (N, 3)."""
        side, reach = self.gate(self.features(points[None]))[0].chunk(2, dim=1)
        return side, reach

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 3) points and tangents → the same shape."""
        features = self.features(x)
        side, reach = self.gate(features).chunk(2, dim=2)
        reach = torch.cat([reach[:1] - FLOOR, reach[1:]]) * (reach[:1] > FLOOR)
        gates = torch.tanh(SHARPNESS * side[:1]) * reach
        offset: Tensor = self.offset(torch.cat([gates, features], dim=2))
        return x + offset


class FeatureNetworks(SubNetworks):
    """The five sub-networks with features and gates; Deform is the paper's.

    All but Cut have half of its width: what is hard to tell of a surface is where and how it opens.

    Args:
        hidden: hidden layer sizes of Cut's stack.
        embedding: channels of the embedding in Deform.
        features: of Cut and of Stitch; Wrap has as many of the plane.
        gates: seams at most.
        activation: of all stacks.
        generator: of the weights.
    """

    cut: GatedCut

    def __init__(
        self,
        hidden: tuple[int, ...],
        embedding: int,
        features: int,
        gates: int,
        *,
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        half = tuple(max(1, size // 2) for size in hidden)
        self.deform = OffsetStack(2, embedding, half, activation, generator)
        self.cut = GatedCut(gates, features, hidden, activation, generator)
        self.unwrap = Stack(3, 2, half, activation, generator)
        self.wrap = FeatureStack(2, 3, features, half, activation=activation, generator=generator)
        self.stitch = FeatureStack(3, 3, features, half, activation=activation, generator=generator)
