"""The faces that span a learned seam, and the map with them laid to one bank of it."""

from __future__ import annotations

import numpy as np

from parapoint.parameterization import Parameterization
from parapoint.surface import BoolArray, FloatArray, IntArray, Mesh

LENGTH = 0.01
"""Shortest spanning edge, in sides of the map's square box: T_cut of the paper."""
STRETCH = 5.0
"""How many times more than the edges around either end a spanning edge is stretched."""


def spanning_edges(mesh: Mesh, uv: FloatArray) -> BoolArray:
    """(E,) the edges of `mesh` that a map with one uv (V, 2) for each vertex draws across its seam.

    They are longer in the plane than T_cut, and at both ends stretched STRETCH times as much as
    the lower quartile of the edges there, so that one calm bank tells.
    """
    start, end = mesh.edges.T
    length = np.linalg.norm(uv[end] - uv[start], axis=1)
    real = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    stretch = length / np.maximum(real, 1e-12 * max(real.max(), 1e-300))
    vertex = np.concatenate([start, end])
    order = np.lexsort((np.tile(stretch, 2), vertex))
    degree = np.bincount(vertex, minlength=len(mesh.vertices))
    first = np.cumsum(degree) - degree
    quartile = np.zeros(len(degree))
    used = degree > 0
    quartile[used] = np.tile(stretch, 2)[order][(first + degree // 4)[used]]
    box = np.ptp(uv[mesh.referenced], axis=0).max()
    calm = np.minimum(quartile[start], quartile[end])
    return np.asarray((length > LENGTH * box) & (stretch > STRETCH * calm))


def opened(mesh: Mesh, uv: FloatArray) -> Parameterization:
    """The map of a mesh by one uv (V, 2) for each vertex, cut where edges span the learned seam.

    A face with one edge that does not span stays at that edge's bank: its third corner gets a uv
    of its own, where the face has its true shape. A face of three spanning edges becomes a chart
    of its own, in its true shape, beside its first corner.
    """
    spans = spanning_edges(mesh, uv)[mesh.edge_of_halfedge].reshape(-1, 3)
    rows = [uv]
    corners: IntArray = mesh.faces.copy()
    count = len(uv)
    sound = ~spans.any(axis=1)
    doubled = _doubled_areas(uv[mesh.faces[sound]])
    mirror = 1.0 if doubled.sum() >= 0 else -1.0
    real = mesh.face_areas[sound].sum()
    scale = float(np.sqrt(np.abs(doubled).sum() / 2 / real)) if real > 0 else 1.0
    for face in np.flatnonzero(~sound):
        kept = int(np.argmin(spans[face]))
        at = [kept, (kept + 1) % 3, (kept + 2) % 3]
        a, b, c = mesh.vertices[mesh.faces[face, at]]
        base, side = b - a, c - a
        squared = float(base @ base)
        if squared == 0:
            continue
        along = float(side @ base) / squared
        across = mirror * float(np.linalg.norm(np.cross(base, side))) / squared
        start = uv[mesh.faces[face, at[0]]]
        edge = uv[mesh.faces[face, at[1]]] - start
        if spans[face].all():
            edge = np.array([scale * np.sqrt(squared), 0.0])
            rows += [start[None], (start + edge)[None]]
            corners[face, at[:2]] = count, count + 1
            count += 2
        rows.append((start + along * edge + across * np.array([-edge[1], edge[0]]))[None])
        corners[face, at[2]] = count
        count += 1
    return Parameterization(np.concatenate(rows), corners)


def _doubled_areas(images: FloatArray) -> FloatArray:
    """(F,) twice the signed areas of triangles (F, 3, 2)."""
    first, second = images[:, 1] - images[:, 0], images[:, 2] - images[:, 0]
    return np.asarray(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
