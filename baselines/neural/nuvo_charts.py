"""Several charts in the manner of Nuvo: networks, losses, and the map that they make."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from baselines.neural.nuvo_training import encoded
from baselines.neural.sheets import corner_rows, packed
from baselines.neural.stepping import trained
from parapoint.learned import losses
from parapoint.learned.networks import LeakyReLU, Stack
from parapoint.surfaces.normals import tangent_frames
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sampling import training_points
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

if TYPE_CHECKING:
    from baselines.neural.nuvo import Nuvo

HIDDEN = (128,) * 3
"""Hidden layers of each network; there are 2 for each chart, and one that chooses among them."""
FEATURES = 9
"""Numbers that `encoded` makes of one."""
MOST_POINTS = 256
"""Points of a step at most: each of them goes through the networks of all charts."""
RATE = 3e-3
"""Learning rate at the start; it falls to 0."""
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
        return nn.functional.log_softmax(self.chooser(encoded(points[None]))[0], dim=1)

    def texture(self, chart: int, x: Tensor) -> Tensor:
        """The t of a chart: (1 + T, N, 3) points and tangents → (1 + T, N, 2)."""
        z: Tensor = self.textures[chart](encoded(x))
        uv = torch.sigmoid(z[:1])
        return torch.cat([uv, uv * (1 - uv) * z[1:]])

    def surface(self, chart: int, uv: Tensor) -> Tensor:
        """The s of a chart: (N, 2) → (N, 3)."""
        points: Tensor = self.surfaces[chart](encoded(uv[None]))[0]
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


def charted(method: Nuvo, surface: Surface, seed: int) -> Parameterization | PointParameterization:
    """The map of `method`, whose charts are more than one.

    Raises:
        InputError: fewer than 100 distinct points, or all on a line.
    """
    began = time.perf_counter()
    cloud = training_points(surface, method.points, seed)
    centre = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
    scale = float(np.linalg.norm(cloud - centre, axis=1).max())
    inside = (cloud - centre) / scale
    rows = torch.as_tensor(np.concatenate([inside[None], tangent_frames(inside)])).float()
    generator = torch.Generator().manual_seed(seed)
    networks = ChartNetworks(method.charts, generator)
    size = min(method.subset, MOST_POINTS, len(cloud))

    def terms() -> dict[str, Tensor]:
        chosen = torch.randperm(len(cloud), generator=generator)[: 4 * size]
        square = torch.rand(method.charts, -(-size // method.charts), 2, generator=generator)
        found = chart_terms(networks, rows[:, chosen[:size]], square, rows[0, chosen])
        return {name: WEIGHTS[name] * of for name, of in found.items()}

    steps = trained(networks, terms, RATE, method.iterations, method.time_budget)
    trace = tuple(
        TracePoint(number, time.perf_counter() - began, values)
        for number, values in enumerate(steps, 1)
    )
    everywhere = surface.vertices if isinstance(surface, Mesh) else surface.points
    places = everywhere
    if isinstance(surface, Mesh):
        places = surface.vertices[surface.faces].mean(axis=1)
    at, decided = (
        torch.as_tensor((of - centre) / scale, dtype=torch.float32) for of in (everywhere, places)
    )
    with torch.no_grad():
        chart = networks.log_probabilities(decided).argmax(dim=1).numpy().astype(np.int64)
    report: dict[str, object] = {
        "points": len(cloud),
        "points_of_a_step": size,
        "iterations": len(trace),
        "weights": WEIGHTS,
        "losses": dict(trace[-1].values) if trace else {},
        "charts": len(np.unique(chart)),
    }

    def placed(vertex: IntArray, of_row: IntArray, area: FloatArray) -> FloatArray:
        uv = np.empty((len(vertex), 2))
        for number in range(method.charts):
            mine = of_row == number
            if mine.any():
                with torch.no_grad():
                    uv[mine] = networks.texture(number, at[torch.as_tensor(vertex[mine])][None])[0]
        share = np.bincount(chart, area, method.charts) / area.sum()
        return scale * packed(2 * uv - 1, of_row, share)

    if not isinstance(surface, Mesh):
        uv = placed(np.arange(len(at)), chart, np.ones(len(at)))
        return PointParameterization(uv, trace, report)
    corners, vertex, of_row = corner_rows(chart, surface.faces)
    return Parameterization(placed(vertex, of_row, surface.face_areas), corners, trace, report)
