"""Geometry images: the surface cut to a disk and laid out on a square, to be kept as an image."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from baselines.disks.gridded import image, psnr
from baselines.disks.mean_value import balanced, mean_value_weights
from baselines.disks.stretch import relaxed, stretch, stretches
from parapoint.parameters import check_whole
from parapoint.planar.domains import (
    Domain,
    arc_lengths,
    check_triangles,
    domain,
    far_pair,
    finite,
    scaled,
)
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.cutting import (
    cut_along,
    cut_to_disk,
    edge_graph,
    edge_lengths,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

MOST_CUTS = 30
"""Branches that the cut grows by at most."""
BULGE = 0.01
"""How far the middle of a side of the square stands out, in sides, so that a triangle with all its
corners on one side keeps an area."""


@dataclass(frozen=True)
class GeometryImage:
    """One square chart of even sampling, as geometry images are made.

    X. Gu, S. Gortler and H. Hoppe 2002, "Geometry images". The cut to a disk is the benchmark's,
    and joins holes to one boundary. The surface is embedded with its boundary on the square; then
    the interior moves so that the geometric stretch falls (mean of (1/s1² + 1/s2²) / 2 over the
    area, s1 and s2 the singular values of the map to the plane). The cut grows by the shortest path
    from the boundary to the triangle of greatest stretch, for as long as that lowers the stretch.

    Ours: mean-value weights in place of Floater's older ones, and in place of line searches vertex
    by vertex a reweighting of the embedding (S. Yoshizawa et al. 2004), which never flips either.
    Left out: edges split where a triangle has all its corners on one side of the square, so that
    it stays thin there (BULGE) and longer cuts pay more seldom; cut nodes on pixels, and what else
    makes the image tight across the cut; compression. The report holds the peak signal-to-noise
    ratio of the surface read back.

    Attributes:
        side: pixels on a side of the image that the report judges.
    """

    side: int = 257

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy")

    def __post_init__(self) -> None:
        check_whole("side", self.side, 2, 4096)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: the system has no finite solution.
        """
        began = time.perf_counter()
        whole = domain(surface)
        check_triangles(whole.vertices, whole.faces)
        mesh = cut_to_disk(Mesh(whole.vertices, whole.faces))
        disk, course = laid_out(mesh)
        branches = 0
        while branches < MOST_CUTS:
            path = branch(mesh, stretches(disk, course[0]))
            if len(path) < 2:
                break
            longer = cut_along(mesh, path_edges(path))
            after = laid_out(longer)
            if not stretch(after[0], after[1][-1]) < stretch(disk, course[-1]):
                break
            mesh, (disk, course) = longer, after
            branches += 1
        uv = course[-1]
        seconds = time.perf_counter() - began
        trace = [
            TracePoint(step, seconds, {"stretch_l2": stretch(disk, moved) ** 0.5}, None)
            for step, moved in enumerate(course)
        ]
        report: dict[str, object] = {
            "branches": branches,
            "stretch_l2": stretch(disk, uv) ** 0.5,
            "flipped": int((signed_areas(uv, disk.faces) <= 0).sum()),
            "image_side": self.side,
            "psnr": psnr(disk, image(disk, uv, self.side)),
        }
        return Parameterization(scaled(disk, uv), disk.faces, tuple(trace), report)


def laid_out(mesh: Mesh) -> tuple[Domain, list[FloatArray]]:
    """A disk and the maps (V, 2) of it to the square: the embedding, and as its stretch falls."""
    disk = domain(mesh)
    boundary = square(disk.vertices[disk.loop])
    uv = finite(balanced(mean_value_weights(disk), disk.loop, boundary))
    return disk, [uv, *relaxed(disk, uv)]


def square(points: FloatArray) -> FloatArray:
    """(B, 2) the boundary `points` (B, 3) around the unit square, each corner a point of them.

    The first corner is the point farthest out. Along a side they are spaced by arc length.
    """
    first = far_pair(points)[0]
    lengths = np.roll(arc_lengths(points), -first)
    along = (np.cumsum(lengths) - lengths) / lengths.sum()
    corners = np.unique(np.abs(along - np.arange(4)[:, None] / 4).argmin(axis=1))
    at = np.interp(along, [*along[corners], 1.0], [*range(len(corners)), 4.0])
    side, share = np.divmod(at, 1)
    out = 4 * BULGE * share * (1 - share)
    sides = np.stack([share, -out, 1 + out, share, 1 - share, 1 + out, -out, 1 - share], axis=1)
    placed = sides.reshape(-1, 4, 2)[np.arange(len(points)), side.astype(np.int64) % 4]
    return np.asarray(np.roll(placed, first, axis=0))


def branch(mesh: Mesh, stretched: FloatArray) -> list[int]:
    """The vertices of the shortest path from the most stretched triangle to the boundary."""
    graph = edge_graph(mesh, edge_lengths(mesh))
    distance, previous = ways_to(graph, mesh.boundary_loops[0])
    corners = mesh.faces[int(stretched.argmax())]
    return path_to(previous, int(corners[distance[corners].argmax()]))
