"""What a mean does not show: the worst part of a map, its seam, and its place in the unit square.

The ratio r of a face is its UV area over its 3D area, with each kind of area scaled to sum 1. Where
r is below a quarter (STARVED), a texture has less than half of its fair number of texels along a
side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from benchmarks.metrics.distortion import FaceDistortion, Triangles, percentile
from parapoint.surfaces.areas import LEAST_PART, STARVED
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, edge_components

WINDOW = 2
"""Vertices on either side of one that are averaged with it where a seam is smoothed."""


@dataclass(frozen=True, eq=False)
class Worst:
    """What the metrics of starved parts read.

    Attributes:
        mesh: the surface, with vertices at one place welded.
        distortion: the distortion of the faces that count.
    """

    mesh: Mesh
    distortion: FaceDistortion

    @cached_property
    def starved_parts(self) -> tuple[FloatArray, FloatArray]:
        """(K,), (K,) the share of the surface and the mean ratio r of each starved part.

        Faces that share an edge of the surface are in one part, also where the map is cut between.
        """
        starved = np.flatnonzero(self.distortion.area_ratio < STARVED)
        label = edge_components(self.mesh.faces[self.distortion.faces[starved]])
        share = np.bincount(label, self.distortion.area[starved]).astype(np.float64)
        uv_share = np.bincount(label, self.distortion.uv_area[starved])
        return share, np.asarray(uv_share / share, dtype=np.float64)


def area_ratio_p01(worst: Worst) -> float:
    """The ratio r that the worst hundredth of the surface does not exceed; 0 without any face."""
    distortion = worst.distortion
    if not len(distortion.faces):
        return 0.0
    return percentile(distortion.area_ratio, 1, distortion.area)


def part_area_ratio_min(worst: Worst) -> float:
    """Smallest mean r of a starved part of at least LEAST_PART; 1 where there is no such part.

    It shows an ear or a finger that has collapsed. 0 without any face.
    """
    if not len(worst.distortion.faces):
        return 0.0
    share, ratio = worst.starved_parts
    return float(ratio[share >= LEAST_PART].min(initial=1.0))


def starved_area_fraction(worst: Worst) -> float:
    """Share of the surface where r is below STARVED; 1 without any face."""
    distortion = worst.distortion
    if not len(distortion.faces):
        return 1.0
    return float(distortion.area[distortion.area_ratio < STARVED].sum())


@dataclass(frozen=True, eq=False)
class Layout:
    """What the metrics of the seam's shape and of the unit square read.

    Attributes:
        mesh: the surface, with vertices at one place welded.
        parameterization: the map.
        triangles: its faces.
    """

    mesh: Mesh
    parameterization: Parameterization
    triangles: Triangles


def seam_jaggedness(layout: Layout) -> float:
    """Length of the cut over the length of the same cut when smoothed over four edges.

    The boundary of the surface is no part of the cut. A straight cut scores 1, and so does a map
    without a cut. The cut is split into lines at its ends and branching points. Along each line, a
    vertex is averaged with its neighbours up to two edges away, as many on the one side as on the
    other; the ends of the line stay where they are.
    """
    edges = layout.parameterization.seams(layout.mesh)
    before = after = 0.0
    for line in _lines(edges):
        points = layout.mesh.vertices[line]
        before += _length(points)
        after += _length(_smoothed(points))
    if before == 0:
        return 1.0
    return before / after if after > 0 else float("inf")


def _length(points: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _smoothed(points: FloatArray) -> FloatArray:
    """(N, 3) a polyline with each vertex averaged with up to WINDOW others on either side."""
    count = len(points)
    is_closed = count > 2 * WINDOW and np.array_equal(points[0], points[-1])
    if is_closed:
        around = points[np.arange(-WINDOW, count - 1 + WINDOW) % (count - 1)]
        mean = np.mean([around[k : k + count - 1] for k in range(2 * WINDOW + 1)], axis=0)
        return np.concatenate([mean, mean[:1]])
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(points, axis=0)])
    row = np.arange(count)
    reach = np.minimum(WINDOW, np.minimum(row, count - 1 - row))
    return np.asarray(
        (total[row + reach + 1] - total[row - reach]) / (2 * reach + 1)[:, None], dtype=np.float64
    )


def _lines(edges: IntArray) -> list[list[int]]:
    """The lines that edges (E, 2) form: their vertices in order, from node to node or round a loop.

    A node is a vertex at which one edge ends, or more than two edges meet.
    """
    around: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    nodes = [vertex for vertex, near in around.items() if len(near) != 2]
    walked: set[tuple[int, int]] = set()

    def walk(start: int, onwards: int) -> list[int]:
        line = [start, onwards]
        walked.update([(start, onwards), (onwards, start)])
        while len(around[line[-1]]) == 2 and line[-1] != start:
            a, b = around[line[-1]]
            step = b if a == line[-2] else a
            walked.update([(line[-1], step), (step, line[-1])])
            line.append(step)
        return line

    lines = [walk(v, w) for v in nodes for w in around[v] if (v, w) not in walked]
    lines += [walk(v, w) for v, near in around.items() for w in near if (v, w) not in walked]
    return lines


def uv_outside_unit(layout: Layout) -> float:
    """Largest distance of a uv from the unit square; 0 if all of them lie in it."""
    used = layout.parameterization.uv[layout.parameterization.corners.reshape(-1)]
    return float(np.linalg.norm(used - np.clip(used, 0.0, 1.0), axis=1).max(initial=0.0))


def mirrored_area_fraction(layout: Layout) -> float:
    """Share of the UV area that is mirrored, turned against its faces; 1 without any UV area."""
    uv_area = layout.triangles.uv_area
    total = float(np.abs(uv_area).sum())
    return float(np.abs(uv_area[uv_area < 0]).sum()) / total if total > 0 else 1.0
