"""Tangent space of a mesh with a map, in which glTF's normal maps are written."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.sides import parted
from parapoint.surfaces.surface import FloatArray, IntArray, vertex_normals
from parapoint.textures.texels import Texels


def corner_tangents(charted: Charted, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(F, 3, 3) unit tangents at the corners, and (F,) the handedness of each face, 1 or −1.

    As MikkTSpace has them (Mikkelsen 2008, "Simulation of wrinkled surfaces revisited"), the
    convention of glTF: the direction in which u grows, laid into the plane of the vertex normal, is
    averaged by angle in that plane over the faces around a vertex that share its uv, edge by edge,
    and a handedness.

    Args:
        charted: the mesh and its map.
        normals: (V, 3) of the vertices.
    """
    mesh, held = charted
    points, uv = mesh.vertices[mesh.faces], held.uv[held.corners]
    first, second = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    du, dv = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    hand = np.where(du[:, 0] * dv[:, 1] - du[:, 1] * dv[:, 0] < 0, -1.0, 1.0)
    along = hand[:, None] * (first * dv[:, 1:] - second * du[:, 1:])
    normal = normals[mesh.faces]
    tangents = _laid(along[:, None], normal)
    before = _laid(np.roll(points, 1, axis=1) - points, normal)
    after = _laid(np.roll(points, -1, axis=1) - points, normal)
    angle = np.arccos(np.clip((before * after).sum(axis=2, keepdims=True), -1, 1))
    group = _fans(charted, hand)
    total = np.zeros((int(group.max()) + 1, 3))
    np.add.at(total, group, (angle * tangents).reshape(-1, 3))
    return _unit(total[group].reshape(-1, 3, 3)), hand


def _fans(charted: Charted, hand: FloatArray) -> IntArray:
    """(3 F,) the fan of faces that each corner belongs to.

    Faces next to one another are of one fan where they share both ends of their edge, in space and
    in the plane, and their handedness (F,).
    """
    faces = charted.mesh.faces
    key = np.stack([faces, charted.map.corners, np.broadcast_to(hand[:, None], faces.shape)], 2)
    place = np.unique(key.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1)
    corner = np.arange(faces.size)
    ahead = np.roll(corner.reshape(-1, 3), -1, axis=1).reshape(-1)
    ends = np.stack([corner, ahead], axis=1)
    ends = np.where((place < place[ahead])[:, None], ends, ends[:, ::-1])
    order = np.lexsort(place[ends].T)
    ends = ends[order]
    same = (place[ends[1:]] == place[ends[:-1]]).all(axis=1)
    one, other = ends[1:][same].reshape(-1), ends[:-1][same].reshape(-1)
    size = (len(corner), len(corner))
    joined = sparse.coo_matrix((np.ones(len(one), bool), (one, other)), size)
    return np.asarray(csgraph.connected_components(joined, directed=False)[1], dtype=np.int64)


def in_tangent_space(shown: Texels) -> Callable[[FloatArray, slice], FloatArray]:
    """A function: normals (k, 3) in space, at some texels → unit normals in tangent space.

    The second axis is the direction in which v grows. As a viewer does, the interpolated tangent
    and normal are taken as they come, without making them orthogonal or of length 1.
    """
    mesh = parted(shown.charted.mesh)
    normals = vertex_normals(mesh)
    tangents, hand = corner_tangents(Charted(mesh, shown.charted.map), normals)
    corner_normals = normals[mesh.faces]

    def seen(space: FloatArray, rows: slice) -> FloatArray:
        faces, weights = shown.faces[rows], shown.weights(rows)
        normal = np.einsum("nc,ncd->nd", weights, corner_normals[faces])
        tangent = np.einsum("nc,ncd->nd", weights, tangents[faces])
        bitangent = hand[faces][:, None] * np.cross(normal, tangent)
        axes = np.stack([tangent, bitangent, normal], axis=2)
        known = np.abs(np.linalg.det(axes)) > 1e-6
        inside = np.zeros_like(space)
        inside[:, 2] = 1.0  # where the mesh has no normal: straight out
        inside[known] = np.linalg.solve(axes[known], _unit(space[known])[:, :, None])[:, :, 0]
        return _unit(inside)

    return seen


def _laid(vectors: FloatArray, normals: FloatArray) -> FloatArray:
    """Vectors laid into the planes of unit normals, of length 1."""
    return _unit(vectors - (normals * vectors).sum(axis=-1, keepdims=True) * normals)


def _unit(vectors: FloatArray) -> FloatArray:
    """Vectors of length 1; 0 stays."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-300))
