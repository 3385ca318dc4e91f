"""A part of a surface around a seed triangle that flattens well, in the manner of DA-Wand."""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from baselines.disk_regions import Region, distortion, flattened
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.parameters import check_number, check_whole
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

GROWTH = 0.3
"""Share by which a region may grow before its map is solved anew."""
LEAST = 0.02
"""Share of a region that is given up together once it distorts the map too much."""
HEADROOM = 0.7
"""Share of the bound to which a region grows; smoothing its border may take the rest."""
FIRST = 12
"""Triangles of the first region, whose map is taken as it is."""


@dataclass(frozen=True)
class DAWand:
    """A large disk around a seed triangle that flattens within a bound, and its isometric map.

    R. Liu, N. Aigerman, V. G. Kim and R. Hanocka 2023, "DA Wand: distortion-aware selection using
    neural mesh parameterization". Its network, which selects the triangles, is not here. A greedy
    growth stands in for it: from the seed on the nearest triangles are added, the map of the region
    is solved anew (least-squares conformal, then as rigid as possible), and those with which its
    mean distortion (s1 - 1)² + (s2 - 1)² exceeds the bound are given up. The region is a disk
    throughout. Like the paper's flood fill and graph cut, a majority of the neighbours then smooths
    its border. All other faces have no uv; the map is the whole of the work, not an atlas.

    Attributes:
        triangle: face from which the region grows.
        distortion: largest mean distortion of the region.
    """

    triangle: int = 0
    distortion: float = 0.01

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("libigl",)

    def __post_init__(self) -> None:
        check_whole("triangle", self.triangle, 0)
        check_number("distortion", self.distortion, 0, above=True)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map of the region, in the scale of the surface; the rest is left out.

        Raises:
            UnsupportedError: the surface is a cloud.
            InputError: there is no such triangle, or it has no area.
            FlatteningError: the map of a region is not finite.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        if self.triangle >= len(surface.faces):
            last = len(surface.faces) - 1
            raise InputError(f"triangle must be a face, 0 to {last}, not {self.triangle}")
        region = Region(surface, self.triangle)
        solves = grown(region, HEADROOM * self.distortion)
        before = region.faces()
        smoothed = Region(surface, self.triangle, before)
        smoothed.smooth()
        if distortion(surface, smoothed.faces()) <= self.distortion:
            region = smoothed
        faces = region.faces()
        uv, each = flattened(surface, faces)
        share = surface.face_areas[faces]
        report: dict[str, object] = {
            "faces": len(faces),
            "share": float(share.sum() / surface.face_areas.sum()),
            "distortion": float(each @ share / share.sum()),
            "solves": solves,
        }
        size = len(surface.vertices)
        corners = surface.faces + size  # a row for each vertex outside, and one inside
        corners[faces] -= size
        rows, corners = np.unique(corners, return_inverse=True)
        both = np.concatenate([uv, np.full((size, 2), np.nan)])
        return Parameterization(both[rows], corners.reshape(-1, 3), report=report)


def grown(region: Region, bound: float) -> int:
    """Let a region grow until nothing more can be added within the bound; how many maps it took.

    The nearest faces come first, by paths from centre to centre; a batch that exceeds the bound is
    halved, and the smallest is given up.
    """
    mesh = region.mesh
    centres: FloatArray = mesh.vertices[mesh.faces].mean(axis=1)
    distance = {region.seed: 0.0}
    heap: list[tuple[float, int]] = []

    def reach(face: int) -> None:
        for other in region.beside[face].tolist():
            if other >= 0 and not region.inside[other]:
                far = distance[face] + float(np.linalg.norm(centres[other] - centres[face]))
                if far < distance.get(other, np.inf):
                    distance[other] = far
                heapq.heappush(heap, (distance[other], other))

    def taken(count: int) -> list[int]:
        added: list[int] = []
        while heap and len(added) < count:
            _, face = heapq.heappop(heap)
            if region.fits(face):
                region.add(face)
                added.append(face)
                reach(face)
        return added

    reach(region.seed)
    taken(FIRST)
    solves, size = 0, FIRST
    while added := taken(size):
        solves += 1
        count = int(region.inside.sum())
        if distortion(mesh, region.faces()) <= bound:
            size = max(1, min(2 * len(added), int(GROWTH * count)))
            continue
        for face in added:
            region.drop(face)
        if len(added) <= max(1, LEAST * count):
            region.blocked[added] = True
        else:
            size = len(added) // 2
        heap.clear()
        for face in region.faces().tolist():
            reach(face)
    return solves
