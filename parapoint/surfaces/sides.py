"""The two sides of a sheet of which each face is there both ways: leaves, cloth, hair."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.surfaces.surface import BoolArray, IntArray, Mesh


def parted(mesh: Mesh, is_other: BoolArray | None = None) -> Mesh:
    """The mesh with vertices of their own for the other sides of its sheets, behind all others.

    Args:
        mesh: any mesh.
        is_other: (F,) which faces those are, if that is known already.
    """
    if is_other is None:
        is_other = other_sides(mesh.faces)
    if not is_other.any():
        return mesh
    faces = mesh.faces + len(mesh.vertices) * is_other[:, None]
    return Mesh(np.concatenate([mesh.vertices, mesh.vertices]), faces)


def other_sides(faces: IntArray) -> BoolArray:
    """(F,) whether a face has the corners of another one, and is on the other side of its sheet.

    Faces that turn alike across their edges are on one side. The other side is the smaller one: of
    a surface it is the odd face that is there both ways. On a one-sided sheet the second face of
    each pair counts as the other side.
    """
    _, first, triple = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_inverse=True
    )
    triple, rows, least = triple.reshape(-1), np.arange(len(faces)), faces.argmin(axis=1)
    turn = (faces[rows, (least + 1) % 3] < faces[rows, (least + 2) % 3]).astype(np.int64)
    is_second: BoolArray = np.asarray(turn != turn[first[triple]], dtype=bool)
    is_double: BoolArray = np.asarray(np.isin(triple, triple[is_second]), dtype=bool)
    if not is_double.any():
        return is_second
    side = _sides(faces, triple, turn)
    size = np.bincount(side[2 * triple + turn], minlength=len(side))
    own, across = side[2 * triple + turn], side[2 * triple + 1 - turn]
    smaller = np.where(size[own] == size[across], own > across, size[own] < size[across])
    return is_double & np.where(own == across, is_second, smaller)


def _sides(faces: IntArray, triple: IntArray, turn: IntArray) -> IntArray:
    """(2 T,) the side that each of T triples of corners is on in either turn.

    Sides go on across the edges of two triples.

    Args:
        faces: (F, 3).
        triple: (F,) the number of each face's corners, whichever way it turns.
        turn: (F,) which way it turns, 0 or 1.
    """
    size = 2 * (int(triple.max()) + 1)
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(start, end) * (int(faces.max()) + 1) + np.maximum(start, end)
    node = np.repeat(2 * triple + turn, 3)
    pairs = np.unique(np.stack([key, node // 2], axis=1), axis=0)
    keys, begin, count = np.unique(pairs[:, 0], return_index=True, return_counts=True)
    edge = np.searchsorted(keys, key)
    is_link = count[edge] == 2
    slot = 2 * (start < end) + (node // 2 != pairs[begin[edge], 1])
    met = np.full((len(keys), 4), -1)
    met[edge[is_link], slot[is_link]] = node[is_link]
    links = np.concatenate([met[:, [0, 3]], met[:, [1, 2]]])
    links = links[(links >= 0).all(axis=1)]
    graph = sparse.coo_matrix((np.ones(len(links), bool), links.T), (size, size))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)
