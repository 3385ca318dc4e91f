"""Surfaces of several components: what they are, and one map of all made of a map of each."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree
from torch import Tensor, nn

from parapoint.networks import SurfaceNetworks
from parapoint.surface import FloatArray, IntArray, Mesh, PointCloud, Surface

NEIGHBOURS = 8
"""Points joined to each point of a cloud. It needs no length, so uneven density is no matter; and
more than so many points that are nearer to each other than to all others stand apart."""
FEWEST = 100
"""Points of a component of a cloud; smaller ones go with the nearest that is larger."""
SAMPLE = 200_000
"""Most points of a cloud among which components are looked for; the others go with the nearest."""
GAP = 0.02
"""Between charts, in widths of the widest."""


def components(surface: Surface) -> list[Surface]:
    """The components of a surface, largest first (a mesh's by area, a cloud's by points).

    Of a mesh: faces that share vertices, left out where they have no area. Of a cloud: connected
    components of the graph that joins each point to its NEIGHBOURS nearest.
    """
    if isinstance(surface, Mesh):
        label = surface.face_components
        area = np.bincount(label, weights=surface.face_areas)
        order = [k for k in np.argsort(-area, kind="stable") if area[k] > 0]
        return [_submesh(surface, label == k) for k in order] or [surface]
    label = cloud_labels(surface.points)
    by_size = np.argsort(-np.bincount(label), kind="stable")
    normals = surface.normals
    return [
        PointCloud(surface.points[label == k], None if normals is None else normals[label == k])
        for k in by_size
    ]


def cloud_labels(points: FloatArray) -> IntArray:
    """(N,) the component, from 0, of each of (N, 3) points; see `components`."""
    size = min(len(points), SAMPLE)
    sample = np.unique(points[np.random.default_rng(0).permutation(len(points))[:size]], axis=0)
    near = cKDTree(sample).query(sample, min(NEIGHBOURS + 1, len(sample)))[1][:, 1:]
    rows = np.repeat(np.arange(len(sample)), near.shape[1])
    graph = sparse.coo_matrix((np.ones(len(rows), bool), (rows, near.ravel())), [len(sample)] * 2)
    label = csgraph.connected_components(graph, directed=False)[1]
    large = np.bincount(label)[label] >= FEWEST
    if not large.any():
        return np.zeros(len(points), dtype=np.int64)
    nearest = cKDTree(sample[large]).query(points)[1]
    return np.unique(label[large][nearest], return_inverse=True)[1].astype(np.int64)


def _submesh(mesh: Mesh, chosen: np.ndarray) -> Mesh:
    """These faces (F,) and their vertices."""
    used, faces = np.unique(mesh.faces[chosen], return_inverse=True)
    return Mesh(mesh.vertices[used], faces.reshape(-1, 3))


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
