"""The start of `learned`: a computed map, written down so that networks can be taught it.

The cloud is triangulated, cut open along short seams and flattened (`parapoint.computed`). Of this
map the networks are shown values, derivatives, and on which side of which seam a point lies; then
they go on by themselves. Nothing of it stays in a fitted model.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np
from scipy.sparse import csgraph

from parapoint.computed.flattening import Flattened, flattened
from parapoint.surfaces.cutting import edge_graph, edge_lengths
from parapoint.surfaces.normals import tangents_of
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

REACH = 0.15
"""Distance along the surface, in its radii, over which a gate is whole; it then falls to 0."""


class Start(NamedTuple):
    """A map of a surface at N points, near which it is affine but for jumps at seams.

    Attributes:
        rows: (N,) rows of the cloud.
        points: (N, 3).
        frames: (2, N, 3) orthonormal tangent vectors, right-handed around normals that agree.
        gradients: (2, N, 3) of u and of v.
        offsets: (N, 2); the map near a point is u = gradients · x + offset.
        gates: (N, G) for each seam 1 on its left side, −1 on its right side, and between these
            where the surface leads around the end of the seam or away from it.
    """

    rows: IntArray
    points: FloatArray
    frames: FloatArray
    gradients: FloatArray
    offsets: FloatArray
    gates: FloatArray


class Seam(NamedTuple):
    """A line along which a surface is cut open, between two ends or branchings of the cut.

    Attributes:
        left, right: vertices of the cut surface on its two sides, copies of the same ones.
    """

    left: IntArray
    right: IntArray


def computed_start(points: FloatArray, gates: int, deadline: float = math.inf) -> Start:
    """A start from the computed map of distinct points (N, 3), with gates for the longest seams.

    Args:
        points: the cloud.
        gates: columns of `Start.gates`; those beyond the number of seams are 0.
        deadline: when the map is improved no more, by `clock.worked`.

    Raises:
        ReconstructionError: the points show no surface that can be followed and flattened.
    """
    flat = flattened(points, deadline, "balanced")
    chosen = flat.chosen()
    gradients = flat.jacobians()[chosen].transpose(1, 0, 2)
    at = points[flat.rows]
    offsets = flat.uv[chosen] - np.einsum("cni,ni->nc", gradients, at)
    longest = sorted(seams(flat), key=lambda seam: len(seam.left), reverse=True)[:gates]
    values = np.zeros((len(at), gates))
    for column, seam in enumerate(longest):
        values[:, column] = gate(flat.disk, seam)[chosen]
    return Start(flat.rows, at, _frames(flat.mesh), gradients, offsets, values)


def gate(disk: Mesh, seam: Seam) -> FloatArray:
    """(M,) the gate of a seam at the vertices of the cut surface.

    Its size is the way around the end of the seam to its other side, up to REACH, and falls to 0
    between REACH and twice REACH from the seam.
    """
    graph = edge_graph(disk, edge_lengths(disk))
    to_left, to_right = (
        csgraph.dijkstra(graph, indices=side, min_only=True) for side in (seam.left, seam.right)
    )
    around = np.nan_to_num(to_right - to_left, nan=0.0)
    away = 2 - np.minimum(to_left, to_right) / REACH
    return np.asarray(np.clip(around / REACH, -1, 1) * np.clip(away, 0, 1))


def seams(flat: Flattened) -> list[Seam]:
    """The seams of a cut surface; vertices that lie on both sides, its tips, belong to neither."""
    copies: dict[tuple[int, int], list[int]] = {}
    for start, end in flat.disk.halfedges[_on_boundary(flat.disk)].tolist():
        copies[int(flat.origin[start]), int(flat.origin[end])] = [start, end]
    cut = np.array([pair for pair in copies if pair[::-1] in copies and pair[0] < pair[1]])
    rim = flat.mesh.halfedges[_on_boundary(flat.mesh)]
    found = []
    for path in _paths(
        cut.reshape(-1, 2).astype(np.int64), np.unique(rim), len(flat.mesh.vertices)
    ):
        steps = list(itertools.pairwise(path))
        left = {vertex for i, j in steps for vertex in copies[i, j]}
        right = {vertex for i, j in steps for vertex in copies[j, i]}
        seam = Seam(
            *(np.array(sorted(side), dtype=np.int64) for side in (left - right, right - left))
        )
        if len(seam.left) and len(seam.right):
            found.append(seam)
    return found


def _on_boundary(mesh: Mesh) -> BoolArray:
    """(H,) which halfedges lie on the boundary."""
    return np.asarray(mesh.edge_face_count[mesh.edge_of_halfedge] == 1)


def _paths(edges: IntArray, ends: IntArray, count: int) -> list[list[int]]:
    """Edges (E, 2) of `count` vertices as paths between `ends` and where not two of them meet."""
    stops = np.bincount(edges.reshape(-1), minlength=count) != 2
    stops[ends] = True
    around: dict[int, list[int]] = {}
    for i, j in edges.tolist():
        around.setdefault(i, []).append(j)
        around.setdefault(j, []).append(i)
    walked: set[tuple[int, int]] = set()

    def path_from(start: int, following: int) -> list[int]:
        path = [start, following]
        walked.update([(start, following), (following, start)])
        while not stops[path[-1]]:
            onward = [v for v in around[path[-1]] if (path[-1], v) not in walked]
            if not onward:
                break  # a loop has come back to where it began
            walked.update([(path[-1], onward[0]), (onward[0], path[-1])])
            path.append(onward[0])
        return path

    # First the paths that begin at a stop; what is left are loops.
    starts = [i for i in around if stops[i]] + [i for i in around if not stops[i]]
    return [path_from(i, j) for i in starts for j in around[i] if (i, j) not in walked]


def _frames(mesh: Mesh) -> FloatArray:
    """(2, V, 3) orthonormal tangent vectors, right-handed around the normals of a mesh."""
    corners = mesh.vertices[mesh.faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros((len(mesh.vertices), 3))
    for corner in mesh.faces.T:
        np.add.at(normals, corner, of_faces)
    return tangents_of(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))
