"""Cut a mesh open: to a disk along a short cut, or along edges that are given.

The automatic cut is the same for every method, so it must be short and must not favour any. It
grows from what is open already, one shortest arc after another:

- Nothing is open, genus 0 (a sphere): the shortest edge path between two far vertices.
- Nothing is open, genus > 0: a short loop that does not separate the surface. It is the shortest
  of the loops that greedy tree-cotree decompositions find at some vertices spread over the surface
  (Erickson and Whittlesey 2005, "Greedy optimal homotopy and homology generators").
- Something is open: shortest arcs between points of the boundary or of the cut so far, found by the
  same decomposition with all of these as its root. Each arc cuts a handle or joins two boundary
  loops; the surface stays connected, and in the end it is a disk.

A planar domain with holes is cut too when it comes here. The harness does not send it here, as
methods for disks can leave its inner loops free (`parapoint.surfaces.preparation`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.errors import InputError
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

ROOTS = 8
"""Vertices at which loops are sought on a closed surface with handles."""


def cut_to_disk(mesh: Mesh) -> Mesh:
    """The mesh cut open along a short edge path, as a disk; a disk comes back as it is.

    Faces keep their order and their corners their positions. The first rows of the vertices are
    those of `mesh`, the copies along the cut follow.

    Args:
        mesh: connected, manifold, consistently oriented; any genus, any number of boundary loops.

    Raises:
        InputError: the mesh is not so; a caller splits components beforehand.
    """
    if not mesh.is_connected_surface:
        raise InputError(
            f"only a connected, manifold, consistently oriented mesh can be cut to a disk; "
            f"this one is: {mesh.topology}"
        )
    if mesh.topology == "disk":
        return mesh
    disk = _cut_at(mesh, disk_cut(mesh))
    assert disk.topology == "disk", disk.topology
    return disk


def cut_along(mesh: Mesh, edges: IntArray) -> Mesh:
    """The mesh cut open along some of its edges; it may fall apart.

    An inner vertex is split where at least two of its edges are cut (one, if it is on the
    boundary), so a lone inner edge opens nothing. Order of faces and vertices as in `cut_to_disk`.

    Args:
        mesh: any mesh; faces stay joined at non-manifold edges that are not cut.
        edges: (E, 2) vertices of each edge, in any order; boundary edges have no effect.

    Raises:
        InputError: `edges` has another shape, or a row is no edge of the mesh.
    """
    edges = np.asarray(edges, dtype=np.int64)
    if edges.ndim != 2 or edges.shape[1] != 2:
        raise InputError(f"edges must have shape (n, 2), not {edges.shape}")
    inside = ((edges >= 0) & (edges < len(mesh.vertices))).all(axis=1)
    unknown = ~(inside & np.isin(_edge_keys(mesh, edges), _edge_keys(mesh, mesh.edges)))
    if unknown.any():
        raise InputError(f"{edges[unknown][0].tolist()} is no edge of the mesh")
    return _cut_at(mesh, edge_mask(mesh, edges))


def _edge_keys(mesh: Mesh, pairs: IntArray) -> IntArray:
    """(n,) one number for each undirected pair (n, 2) of vertices."""
    return np.asarray(np.sort(pairs, axis=1) @ [len(mesh.vertices), 1], dtype=np.int64)


def edge_mask(mesh: Mesh, pairs: IntArray) -> BoolArray:
    """(E,) which edges of the mesh are among the `pairs` (n, 2) of vertices."""
    return np.asarray(np.isin(_edge_keys(mesh, mesh.edges), _edge_keys(mesh, pairs)), dtype=bool)


def _cut_at(mesh: Mesh, cut: BoolArray) -> Mesh:
    """The mesh with corners joined only across edges that are not in `cut` (E,)."""
    corner = np.arange(3 * len(mesh.faces))
    following = np.roll(corner.reshape(-1, 3), -1, axis=1).reshape(-1)
    forward = mesh.halfedges[:, 0] < mesh.halfedges[:, 1]
    low, high = np.where(forward, (corner, following), (following, corner))
    # Halfedges by edge: each is joined to the one before it if both are of one uncut edge.
    order = np.argsort(mesh.edge_of_halfedge, kind="stable")
    edge = mesh.edge_of_halfedge[order]
    joined = (edge[1:] == edge[:-1]) & ~cut[edge[1:]]
    a, b = order[:-1][joined], order[1:][joined]
    links = np.concatenate([low[a], high[a]]), np.concatenate([low[b], high[b]])
    graph = sparse.coo_matrix((np.ones(len(links[0]), dtype=bool), links), (corner.size,) * 2)
    count, fan = csgraph.connected_components(graph, directed=False)
    vertex_of_fan = np.empty(count, dtype=np.int64)
    vertex_of_fan[fan] = mesh.faces.reshape(-1)
    # The first fan of a vertex keeps its row, each further one is a copy.
    _, first = np.unique(vertex_of_fan, return_index=True)
    copies = np.setdiff1d(np.arange(count), first)
    row = vertex_of_fan.copy()
    row[copies] = len(mesh.vertices) + np.arange(len(copies))
    vertices = np.concatenate([mesh.vertices, mesh.vertices[vertex_of_fan[copies]]])
    return Mesh(vertices, row[fan].reshape(-1, 3))


def edge_lengths(mesh: Mesh) -> FloatArray:
    """(E,) 3D lengths of the edges, at least 1e-12 of the longest: scipy's graphs drop zeros."""
    ends = mesh.vertices[mesh.edges]
    lengths = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)
    return np.asarray(np.maximum(lengths, 1e-12 * lengths.max() or 1.0))


def disk_cut(mesh: Mesh, cost: FloatArray | None = None) -> BoolArray:
    """(E,) the edges along which `mesh`, which is no disk, opens to a disk.

    Args:
        mesh: connected, manifold, consistently oriented.
        cost: (E,) positive cost of cutting each edge; its length by default.
    """
    lengths = edge_lengths(mesh) if cost is None else cost
    cut = mesh.edge_face_count == 1
    if not cut.any() and mesh.genus == 0:
        return _far_path(mesh, lengths)
    if not cut.any():
        loops = [_arcs(mesh, lengths, cut, np.array([root]), 1) for root in _spread(mesh, lengths)]
        cut = min(loops, key=lambda loop: float(lengths[loop].sum()))
        missing = 2 * mesh.genus - 1
    else:
        missing = 2 * mesh.genus + len(mesh.boundary_loops) - 1
    while missing:
        # Half of the missing arcs at a time: later ones may start from earlier ones.
        count = (missing + 1) // 2
        cut = _arcs(mesh, lengths, cut, np.unique(mesh.edges[cut]), count)
        missing -= count
    return np.asarray(cut & (mesh.edge_face_count == 2), dtype=bool)


def edge_graph(mesh: Mesh, lengths: FloatArray) -> sparse.csr_matrix:
    """The symmetric (V, V) graph of the edges."""
    i, j = mesh.edges.T
    size = len(mesh.vertices)
    upper = sparse.coo_matrix((lengths, (i, j)), (size, size))
    return (upper + upper.T).tocsr()


def _spread(mesh: Mesh, lengths: FloatArray) -> list[int]:
    """ROOTS vertices far from each other, by edge distance."""
    graph = edge_graph(mesh, lengths)
    roots: list[int] = []
    distance = csgraph.dijkstra(graph, indices=mesh.faces[0, 0])
    while len(roots) < ROOTS:
        roots.append(int(np.where(mesh.referenced, distance, -1).argmax()))
        distance = np.minimum(distance, csgraph.dijkstra(graph, indices=roots[-1]))
        if len(roots) == 1:  # the vertex where it began was arbitrary
            distance = csgraph.dijkstra(graph, indices=roots[0])
    return roots


def _far_path(mesh: Mesh, lengths: FloatArray) -> BoolArray:
    """(E,) the edges of a shortest path between two far vertices, at least two edges long."""
    graph = edge_graph(mesh, lengths)
    start = mesh.faces[0, 0]
    for _ in range(2):  # the farthest of the farthest
        distance, previous = csgraph.dijkstra(graph, indices=start, return_predecessors=True)
        end = int(np.where(np.isfinite(distance), distance, -1).argmax())
        start = end
    path = path_to(previous, end)
    if len(path) == 2:  # one edge opens nothing: go on to a third corner of a face
        face = next(row for row in mesh.faces.tolist() if set(path) <= set(row))
        path += [vertex for vertex in face if vertex not in path]
    return edge_mask(mesh, path_edges(path))


def origin(mesh: Mesh, cut: Mesh) -> IntArray:
    """(V',) the vertex of `mesh` that each one of `cut`, the same mesh cut open, is or copies."""
    rows = np.empty(len(cut.vertices), dtype=np.int64)
    rows[cut.faces] = mesh.faces
    return rows


def ways_to(graph: sparse.csr_matrix, roots: IntArray) -> tuple[FloatArray, IntArray]:
    """(V,) each vertex's distance from the nearest of the roots, and the next vertex on the way.

    The next vertex is negative at a root, and where no way leads to one.
    """
    distance, previous, _ = csgraph.dijkstra(
        graph, indices=roots, return_predecessors=True, min_only=True
    )
    return distance, previous


def path_to(previous: IntArray, vertex: int) -> list[int]:
    """The vertices from one back to the root of its tree, given each vertex's predecessor (V,)."""
    path = [vertex]
    while previous[path[-1]] >= 0:
        path.append(int(previous[path[-1]]))
    return path


def path_edges(path: Sequence[int] | IntArray) -> IntArray:
    """(n - 1, 2) the edges along a path of n vertices."""
    vertices = np.asarray(path, dtype=np.int64)
    return np.stack([vertices[:-1], vertices[1:]], axis=1)


def _arcs(
    mesh: Mesh, lengths: FloatArray, cut: BoolArray, sources: IntArray, count: int
) -> BoolArray:
    """(E,) `cut` and the `count` shortest arcs of a greedy system between `sources`.

    The tree is the shortest-path forest of the sources. An edge outside it closes an arc with the
    two tree paths from its ends. The cotree is a spanning tree of the faces that crosses neither
    cut nor tree, and rather crosses edges of long arcs; the edges left over close the system.
    """
    distance, previous = ways_to(edge_graph(mesh, lengths), sources)
    i, j = mesh.edges.T
    in_tree = (previous[i] == j) | (previous[j] == i)
    crossable = np.flatnonzero(~cut & ~in_tree)
    arc = distance[i[crossable]] + distance[j[crossable]] + lengths[crossable]

    by_edge = np.argsort(mesh.edge_of_halfedge, kind="stable")
    start = (np.cumsum(mesh.edge_face_count) - mesh.edge_face_count)[crossable]
    faces = np.sort(np.stack([by_edge[start], by_edge[start + 1]], axis=1) // 3, axis=1)
    # No two of these edges lie between the same two faces: the vertex that both would end at has no
    # other edge, so one of them is in the tree.
    cost = 1 + (arc.max() - arc) / arc.max()  # in [1, 2]: no zeros for scipy to drop
    size = len(mesh.faces)
    dual = sparse.coo_matrix((cost, tuple(faces.T)), (size, size)).tocsr()
    crossed = csgraph.minimum_spanning_tree(dual).tocoo()
    in_cotree = np.isin(faces @ [size, 1], crossed.row.astype(np.int64) * size + crossed.col)
    left = np.flatnonzero(~in_cotree)
    shortest = crossable[left[np.argsort(arc[left], kind="stable")[:count]]]

    pairs = [mesh.edges[shortest]]
    tips = np.unique(pairs[0])
    while len(tips := tips[previous[tips] >= 0]):
        pairs.append(np.stack([tips, previous[tips]], axis=1))
        tips = np.unique(previous[tips])
    return cut | edge_mask(mesh, np.concatenate(pairs).astype(np.int64))
