"""Faces across the seam of a map with one uv for each vertex: laid to one side of it, or cut.

Such a map cannot show its seam: the corners of some faces lie on both sides of it. The rule that
finds them here needs the map alone, so that a seam can be cut. The benchmark's *spanning* faces
(`benchmarks.metrics.seams`) are judged by a stricter rule, which asks for an overlap too.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.sparse import csgraph

from parapoint.surfaces.areas import cross
from parapoint.surfaces.cutting import (
    disk_cut,
    edge_graph,
    edge_lengths,
    edge_mask,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.seam_points import STRETCH, THRESHOLD
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

Transform = Callable[[FloatArray], FloatArray]
"""A map of points (N, 3) to the plane (N, 2)."""

MOST_PIECES = 2_000_000
"""The edges together are divided into at most this many pieces, besides one for each edge."""
IN_BAND = 0.1
"""Cost of a cut among the faces across the seam, as a fraction of its cost elsewhere."""
SHORTEST_BRANCH = 4
"""A branch of the seam is followed only if it has at least this many edges."""


def edges_across_seam(
    mesh: Mesh,
    uv: FloatArray,
    transform: Transform | None = None,
    spacing: float = math.inf,
) -> BoolArray:
    """(E,) whether a map with one uv (V, 2) for each vertex draws an edge across its seam.

    They are longer in the plane than T_cut, and stretched more than STRETCH times as much as the
    lower quartile of the edges at one of their ends: the less torn side of the seam decides.

    The two ends of a long edge tell little: it may reach around a limb and end near where it began.
    Given the map as a function, the rule looks at pieces of each edge instead, and an edge lies
    across the seam where one of its pieces does.

    Args:
        mesh: the surface.
        uv: the images of its vertices.
        transform: the whole map, of which `uv` are values.
        spacing: length of the longest piece of an edge, about that between fitted points; pieces
            are longer where there would be too many.
    """
    start, end = mesh.edges.T
    real = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    longest = max(spacing, real.sum() / MOST_PIECES) if transform else math.inf
    count = np.maximum(np.ceil(real / longest), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(count)), count)
    length = _piece_lengths(mesh, uv, transform, count)
    stretch = length / np.maximum(real / count, 1e-12 * max(real.max(), 1e-300))[edge]
    vertex = np.concatenate([start[edge], end[edge]])
    order = np.lexsort((np.tile(stretch, 2), vertex))
    degree = np.bincount(vertex, minlength=len(mesh.vertices))
    first = np.cumsum(degree) - degree
    quartile = np.zeros(len(degree))
    used = degree > 0
    quartile[used] = np.tile(stretch, 2)[order][(first + degree // 4)[used]]
    box = np.ptp(uv[mesh.referenced], axis=0).max()
    calm = np.minimum(quartile[start], quartile[end])[edge]
    across = (length > THRESHOLD * box) & (stretch > STRETCH * calm)
    return np.asarray(np.bincount(edge, across, len(count)) > 0)


def _piece_lengths(
    mesh: Mesh, uv: FloatArray, transform: Transform | None, count: IntArray
) -> FloatArray:
    """(Σ count,) lengths in the plane of the pieces of the edges, `count` (E,) of each."""
    if transform is None or (count == 1).all():
        start, end = mesh.edges.T
        return np.asarray(np.linalg.norm(uv[end] - uv[start], axis=1))
    edge = np.repeat(np.arange(len(count)), count + 1)
    place = np.arange(len(edge)) - np.repeat(np.cumsum(count + 1) - count - 1, count + 1)
    share = (place / count[edge])[:, None]
    start, end = (mesh.vertices[ends] for ends in mesh.edges[edge].T)
    images = transform((1 - share) * start + share * end)
    steps = np.linalg.norm(np.diff(images, axis=0), axis=1)
    return np.asarray(steps[edge[1:] == edge[:-1]])


def faces_across_seam(mesh: Mesh, uv: FloatArray) -> BoolArray:
    """(F,) whether a face has an edge across the seam of a map with one uv (V, 2) a vertex."""
    across = edges_across_seam(mesh, uv)[mesh.edge_of_halfedge]
    return np.asarray(across.reshape(-1, 3).any(axis=1))


def learned_seam(mesh: Mesh, uv: FloatArray) -> BoolArray:
    """(E,) a clean cut along the seam at which a map with one uv (V, 2) for each vertex tears.

    The faces across the seam form a band, where edges are cheap to cut. A closed surface or one
    with handles is opened by the cheapest cut to a disk (a sphere along the longest path in the
    band). Then one branch after another is led from the cut or the boundary to the farthest vertex
    of the band that is left. Branches start only where the surface is open already, so that it
    stays in one piece and, once it is a disk, a disk.

    Args:
        mesh: connected, manifold, consistently oriented.
        uv: (V, 2) the map.
    """
    band = np.zeros(len(mesh.edges), dtype=bool)
    band[mesh.edge_of_halfedge.reshape(-1, 3)[faces_across_seam(mesh, uv)]] = True
    lengths = edge_lengths(mesh)
    cost = np.where(band, IN_BAND, 1.0) * lengths
    inner = mesh.edge_face_count == 2
    cut = ~inner
    if mesh.genus > 0:
        cut = cut | disk_cut(mesh, cost)
    elif not cut.any():
        cut = _longest_path(mesh, cost, band) if band.any() else disk_cut(mesh)
    ends = np.unique(mesh.edges[band])
    graph = edge_graph(mesh, cost)
    while len(ends):
        distance, previous = ways_to(graph, np.unique(mesh.edges[cut]))
        tip = int(ends[distance[ends].argmax()])
        if distance[tip] < SHORTEST_BRANCH * IN_BAND * lengths.mean():
            break
        cut = cut | edge_mask(mesh, path_edges(path_to(previous, tip)))
    return np.asarray(cut & inner)


def _longest_path(mesh: Mesh, cost: FloatArray, band: BoolArray) -> BoolArray:
    """(E,) a path between two far vertices of the largest part of the band (E,)."""
    graph = edge_graph(mesh, np.where(band, cost, 0.0))
    _, label = csgraph.connected_components(graph, directed=False)
    end = int((label == np.bincount(label).argmax()).argmax())
    for _ in range(2):  # the farthest of the farthest
        distance, previous = csgraph.dijkstra(graph, indices=end, return_predecessors=True)
        end = int(np.where(np.isfinite(distance), distance, -1).argmax())
    path = path_to(previous, end)
    if len(path) < 3:  # one edge opens nothing
        return disk_cut(mesh)
    return edge_mask(mesh, path_edges(path))


def opened(mesh: Mesh, uv: FloatArray, across: BoolArray) -> Parameterization:
    """The map of a mesh by one uv (V, 2) for each vertex, cut where edges lie across its seam.

    A face with an edge that is not across the seam stays on the side of that edge: its third corner
    gets a uv of its own, where the face has its true shape. A face with three edges across the seam
    becomes a chart of its own, in its true shape, beside its first corner.

    Args:
        mesh: the surface.
        uv: the images of its vertices.
        across: (E,) whether an edge lies across the seam (see `edges_across_seam`).
    """
    torn = across[mesh.edge_of_halfedge].reshape(-1, 3)
    rows = [uv]
    corners: IntArray = mesh.faces.copy()
    count = len(uv)
    sound = ~torn.any(axis=1)
    corner, left, right = np.moveaxis(uv[mesh.faces[sound]], 1, 0)
    doubled = cross(left - corner, right - corner)
    mirror = 1.0 if doubled.sum() >= 0 else -1.0
    real = mesh.face_areas[sound].sum()
    scale = float(np.sqrt(np.abs(doubled).sum() / 2 / real)) if real > 0 else 1.0
    for face in np.flatnonzero(~sound):
        kept = int(np.argmin(torn[face]))
        at = [kept, (kept + 1) % 3, (kept + 2) % 3]
        a, b, c = mesh.vertices[mesh.faces[face, at]]
        base, side = b - a, c - a
        squared = float(base @ base)
        if squared == 0:
            continue
        along = float(side @ base) / squared
        upward = mirror * float(np.linalg.norm(np.cross(base, side))) / squared
        start = uv[mesh.faces[face, at[0]]]
        edge = uv[mesh.faces[face, at[1]]] - start
        if torn[face].all():
            edge = np.array([scale * np.sqrt(squared), 0.0])
            rows += [start[None], (start + edge)[None]]
            corners[face, at[:2]] = count, count + 1
            count += 2
        rows.append((start + along * edge + upward * np.array([-edge[1], edge[0]]))[None])
        corners[face, at[2]] = count
        count += 1
    return Parameterization(np.concatenate(rows), corners)
