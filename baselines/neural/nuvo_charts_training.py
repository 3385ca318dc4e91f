"""Networks and losses of several charts in the manner of Nuvo (`baselines.neural.nuvo`)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from baselines.neural.nuvo_training import encoded
from parapoint.learned import losses
from parapoint.learned.networks import LeakyReLU, Stack

HIDDEN = (128,) * 3
"""Hidden layers of each network; there are 2 for each chart, and one that chooses among them."""
FEATURES = 3
"""Numbers that stand for a coordinate: itself, a sine and a cosine."""
WEIGHTS = {
    "three_two_three": 1.0,
    "two_three_two": 1.0,
    "surface": 10.0,
    "entropy": 0.05,
    "cluster": 0.1,
    "conformal": 0.4,
    "stretch": 0.1,
}
"""As with one chart; those of entropy and cluster are ours."""


def features(x: Tensor) -> Tensor:
    """(1 + T, N, C) points and tangents → (1 + T, N, C FEATURES), the first rows of `encoded`."""
    return encoded(x)[:, :, : FEATURES * x.shape[2]]


class ChartNetworks(nn.Module):
    """Probabilities c: R³ → [0, 1]ⁿ, and for each chart t: R³ → [0, 1]² and s: R² → R³.

    Attributes:
        sigma: (n,) the learned area of the images of unit squares in each chart.
    """

    def __init__(self, charts: int, generator: torch.Generator) -> None:
        super().__init__()
        rectifier = LeakyReLU(0.0)

        def stacks(inputs: int, outputs: int) -> nn.ModuleList:
            return nn.ModuleList(
                Stack(inputs * FEATURES, outputs, HIDDEN, rectifier, generator)
                for _ in range(charts)
            )

        self.chooser = Stack(3 * FEATURES, charts, HIDDEN, rectifier, generator)
        self.textures, self.surfaces = stacks(3, 2), stacks(2, 3)
        self.sigma = nn.Parameter(torch.ones(charts))

    def log_probabilities(self, points: Tensor) -> Tensor:
        """Logarithms of c: (N, 3) → (N, n)."""
        return nn.functional.log_softmax(self.chooser(features(points[None]))[0], dim=1)

    def texture(self, chart: int, x: Tensor) -> Tensor:
        """The t of a chart: (1 + T, N, 3) points and tangents → (1 + T, N, 2)."""
        z: Tensor = self.textures[chart](features(x))
        uv = torch.sigmoid(z[:1])
        return torch.cat([uv, uv * (1 - uv) * z[1:]])

    def surface(self, chart: int, uv: Tensor) -> Tensor:
        """The s of a chart: (N, 2) → (N, 3)."""
        points: Tensor = self.surfaces[chart](features(uv[None]))[0]
        return points


def chart_terms(
    networks: ChartNetworks, rows: Tensor, square: Tensor, given: Tensor
) -> dict[str, Tensor]:
    """Nuvo's terms, not weighted: what concerns a point counts by its probability in each chart.

    Args:
        networks: of n charts.
        rows: (3, N, 3) points and two orthonormal tangents at each.
        square: (n, M, 2) places in the unit square of each chart.
        given: (P, 3) points of the surface.
    """
    points, charts = rows[0], range(len(square))
    share = networks.log_probabilities(points).exp()
    cycle, angle, stretch = [], [], []
    for chart in charts:
        uv, a, b = networks.texture(chart, rows)
        cycle.append((networks.surface(chart, uv) - points).square().sum(1))
        lengths = (a.square().sum(1) * b.square().sum(1)).clamp(min=losses.EPSILON)
        angle.append((a * b).sum(1).square() / lengths)
        area = (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).abs()
        stretch.append((area - networks.sigma[chart]).square())
    made = torch.stack([networks.surface(chart, square[chart]) for chart in charts])
    again = torch.stack([networks.texture(chart, made[chart][None])[0] for chart in charts])
    own = [networks.log_probabilities(made[chart])[:, chart] for chart in charts]
    centres = share.T @ points / share.sum(0)[:, None].clamp(min=losses.EPSILON)
    everything = made.flatten(0, 1)
    there = given - everything[losses.nearest(given, everything, 1)[:, 0]]
    back = everything - given[losses.nearest(everything, given, 1)[:, 0]]

    def expected(of: list[Tensor]) -> Tensor:
        return (share * torch.stack(of, dim=1)).sum(1).mean()

    return {
        "three_two_three": expected(cycle),
        "two_three_two": (again - square).square().sum(2).mean(),
        "surface": there.square().sum(1).mean() + back.square().sum(1).mean(),
        "entropy": -torch.stack(own).mean(),
        "cluster": (share * torch.cdist(points, centres).square()).sum(1).mean(),
        "conformal": expected(angle),
        "stretch": expected(stretch),
    }
