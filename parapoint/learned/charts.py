"""One map of a surface of several components, made of a map of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor, nn

from parapoint.learned.networks import SurfaceNetworks
from parapoint.surfaces.surface import FloatArray

GAP = 0.02
"""Between charts, in widths of the widest."""


class Chart(NamedTuple):
    """A component with its map.

    Attributes:
        networks: its map, of its points minus `centre`, over `scale`.
        points: (n, 3) points it was fitted to.
        uv: (n, 2) their images, in the points' unit.
        centre: (3,).
        scale: of the component.
    """

    networks: SurfaceNetworks
    points: FloatArray
    uv: FloatArray
    centre: FloatArray
    scale: float


class Charts(SurfaceNetworks):
    """One map made of a map of each component; the charts stand side by side, apart.

    A point is mapped by the component whose fitted points it is nearest to, a point of the plane by
    the chart whose box it is nearest to.

    Args:
        networks: of each component, to be filled by `hold` or by saved tensors.
        count: fitted points of all components.
    """

    points: Tensor
    label: Tensor
    centre: Tensor
    scale: Tensor
    shift: Tensor
    low: Tensor
    high: Tensor

    def __init__(self, networks: list[SurfaceNetworks], count: int) -> None:
        super().__init__()
        self.charts = nn.ModuleList(networks)
        self.register_buffer("points", torch.zeros(count, 3))
        self.register_buffer("label", torch.zeros(count, dtype=torch.int64))
        self.register_buffer("centre", torch.zeros(len(networks), 3))
        self.register_buffer("scale", torch.ones(len(networks)))
        for name in ("shift", "low", "high"):
            self.register_buffer(name, torch.zeros(len(networks), 2))
        self._tree: cKDTree | None = None

    def hold(self, charts: list[Chart], centre: FloatArray, scale: float) -> None:
        """Take over the maps of the components of a surface, in a frame of (x - centre) / scale."""
        low = np.array([chart.uv.min(axis=0) for chart in charts])
        size = np.array([np.ptp(chart.uv, axis=0) for chart in charts])
        width = size[:, 0] + GAP * size[:, 0].max()
        left = np.cumsum(width) - width
        places = np.stack([left, np.zeros(len(charts))], axis=1)
        label = np.repeat(np.arange(len(charts)), [len(chart.points) for chart in charts])
        points = np.concatenate([chart.points for chart in charts])
        for buffer, values in (
            (self.points, (points - centre) / scale),
            (self.label, label),
            (self.centre, (np.array([chart.centre for chart in charts]) - centre) / scale),
            (self.scale, np.array([chart.scale for chart in charts]) / scale),
            (self.shift, (places - low) / scale),
            (self.low, places / scale),
            (self.high, (places + size) / scale),
        ):
            buffer.copy_(torch.from_numpy(values))
        self._tree = None

    def parameterization(self, points: Tensor) -> Tensor:
        """See `SurfaceNetworks`."""
        if self._tree is None:
            self._tree = cKDTree(self.points.cpu().numpy())
        nearest = torch.from_numpy(self._tree.query(points.cpu().numpy())[1])
        label = self.label[nearest.to(points.device)]
        uv = points.new_empty(len(points), 2)
        for k, chart in enumerate(self.charts):
            mine = label == k
            at = (points[mine] - self.centre[k]) / self.scale[k]
            uv[mine] = _map(chart).parameterization(at) * self.scale[k] + self.shift[k]
        return uv

    def surface(self, uv: Tensor) -> Tensor:
        """See `SurfaceNetworks`."""
        outside = (self.low - uv[:, None]).clamp(min=0) + (uv[:, None] - self.high).clamp(min=0)
        label = outside.square().sum(2).argmin(1)
        points = uv.new_empty(len(uv), 3)
        for k, chart in enumerate(self.charts):
            mine = label == k
            at = (uv[mine] - self.shift[k]) / self.scale[k]
            points[mine] = _map(chart).surface(at) * self.scale[k] + self.centre[k]
        return points


def _map(module: nn.Module) -> SurfaceNetworks:
    assert isinstance(module, SurfaceNetworks)
    return module
