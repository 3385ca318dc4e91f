"""The shortest cut into a disk that a greedy search finds, by Erickson and Har-Peled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from baselines.seamster import joining_tree
from parapoint.method import UnsupportedError
from parapoint.planar.descent import Run, sound
from parapoint.surfaces.cutting import (
    cut_along,
    cut_to_disk,
    edge_graph,
    edge_lengths,
    path_edges,
    path_to,
)
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh, Surface

FREE = 1e-9
"""Cost of an edge that is open already, in shortest edges: it is in the cut in any case."""


@dataclass(frozen=True)
class EricksonHarPeled:
    """An isometric map along the shortest cut into a disk that a greedy search finds.

    J. Erickson and S. Har-Peled 2004, "Optimally cutting a surface into a disk", section 5: the
    surface is cut along its shortest cycle that takes a handle away, again and again, until none is
    left; then shortest paths join the holes as a minimal spanning tree. The cycles are exact: the
    shortest through each vertex that any such cycle may pass. Ours: of the paper's essential cycles
    only those that do not separate the surface are cut, so that nothing has to be glued again. A
    sphere needs no cut but a point; there it is the automatic one.

    The map along it is the one to one isometric map of `automatic+slim(price=None)`, so that the
    two differ in the seam alone.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is a cloud.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding of the cut surface has flips.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        mesh = sound(surface)
        cut, cycles = opened(mesh)
        run = Run(cut)
        run.begin()
        run.improve()
        rims = [float(edge_lengths(of)[of.edge_face_count == 1].sum()) for of in (mesh, cut)]
        report = {"cycles": cycles, "cut_length": (rims[1] - rims[0]) / 2}
        return Parameterization(run.uv, run.mesh.faces, report=run.report() | report)


def opened(mesh: Mesh) -> tuple[Mesh, list[float]]:
    """The mesh cut into a disk, and the length of each cycle that took a handle away."""
    lengths = []
    while mesh.genus:
        cycle, length = shortest_cycle(mesh)
        mesh = cut_along(mesh, cycle)
        lengths.append(length)
    if not mesh.boundary_loops:
        return cut_to_disk(mesh), lengths
    if len(mesh.boundary_loops) > 1:
        ends = np.array([loop[0] for loop in mesh.boundary_loops])
        mesh = cut_along(mesh, joining_tree(mesh, edge_lengths(mesh), ends))
    return mesh, lengths


def shortest_cycle(mesh: Mesh) -> tuple[IntArray, float]:
    """(n, 2) the edges of the shortest cycle that does not separate the surface, and its length.

    Holes count as filled, and edges at them cost nothing. Such a cycle meets one of the loops of
    any tree-cotree decomposition: it is the shortest through one of their vertices.
    """
    rim = mesh.edge_face_count == 1
    lengths = edge_lengths(mesh)
    cost = np.where(rim, FREE * lengths.min(), lengths)
    dual = _dual(mesh)
    loops = _loops(mesh, dual, cost, int(mesh.faces[0, 0]))
    best, least = loops[0]
    for root in np.unique(np.concatenate([edges for edges, _ in loops])):
        edges, length = _loops(mesh, dual, cost, int(root), 1)[0]
        if length < least:
            best, least = edges, length
    return best, least


def _dual(mesh: Mesh) -> IntArray:
    """(E, 2) the faces on both sides of each edge; a hole is one more face."""
    order = np.argsort(mesh.edge_of_halfedge, kind="stable")
    last = np.cumsum(mesh.edge_face_count) - 1
    first = last - mesh.edge_face_count + 1
    sides = np.stack([order[first], order[last]], axis=1) // 3
    hole = np.full(len(mesh.vertices), -1)
    for number, loop in enumerate(mesh.boundary_loops):
        hole[loop] = len(mesh.faces) + number
    rim = mesh.edge_face_count == 1
    sides[rim, 1] = hole[mesh.edges[rim, 0]]
    return sides


def _loops(
    mesh: Mesh, dual: IntArray, cost: FloatArray, root: int, count: int | None = None
) -> list[tuple[IntArray, float]]:
    """The shortest loops through a vertex that no others make up, shortest first: edges, length.

    Each edge outside the tree of shortest paths closes a loop. A spanning tree of the faces crosses
    the edges of long loops; twice as many edges are left over as there are handles.
    """
    graph = edge_graph(mesh, cost)
    distance, previous = csgraph.dijkstra(graph, indices=root, return_predecessors=True)
    i, j = mesh.edges.T
    around: FloatArray = distance[i] + distance[j] + cost
    free: BoolArray = ~((previous[i] == j) | (previous[j] == i))
    rows = np.flatnonzero(free)
    rows = rows[np.argsort(-around[rows], kind="stable")]
    size = len(mesh.faces) + len(mesh.boundary_loops)
    # Of two edges between the same two faces scipy would add the costs: it sees the longer alone.
    pairs = np.sort(dual[rows], axis=1) @ [size, 1]
    _, first = np.unique(pairs, return_index=True)
    low, high = np.sort(dual[rows[first]], axis=1).T
    ranked = sparse.coo_array((first + 1.0, (low, high)), (size, size)).tocsr()
    crossed = csgraph.minimum_spanning_tree(ranked).tocoo()
    in_cotree = np.zeros(len(rows), dtype=bool)
    in_cotree[crossed.data.astype(np.int64) - 1] = True
    left = rows[~in_cotree][::-1]
    return [(_cycle(mesh.edges[edge], previous), float(around[edge])) for edge in left[:count]]


def _cycle(edge: IntArray, previous: IntArray) -> IntArray:
    """(n, 2) the edges of the loop that an edge closes, without the way from the root to it."""
    paths = [path_to(previous, int(end)) for end in edge]
    steps = [path_edges(path) for path in paths]
    every = np.concatenate([np.array(edge)[None], *steps])
    edges, times = np.unique(np.sort(every, axis=1), axis=0, return_counts=True)
    return np.asarray(edges[times == 1])
