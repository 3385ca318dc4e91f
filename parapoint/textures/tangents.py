"""Tangent space of a mesh with a map, in which glTF's normal maps are written."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import FloatArray, vertex_normals
from parapoint.textures.texels import Texels


def corner_tangents(charted: Charted, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(F, 3, 3) unit tangents at the corners, and (F,) the handedness of each face, 1 or −1.

    As MikkTSpace has them (Mikkelsen 2008, "Simulation of wrinkled surfaces revisited"), the
    convention of glTF: the direction in which u grows, laid into the plane of the vertex normal, is
    averaged by angle over the faces that share a vertex, a uv and a handedness.

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
    tangents = _unit(along[:, None] - (normal * along[:, None]).sum(axis=2, keepdims=True) * normal)
    before = _unit(np.roll(points, 1, axis=1) - points)
    after = _unit(np.roll(points, -1, axis=1) - points)
    angle = np.arccos(np.clip((before * after).sum(axis=2, keepdims=True), -1, 1))
    key = np.stack(
        [mesh.faces, held.corners, np.broadcast_to(hand[:, None], mesh.faces.shape)], axis=2
    )
    _, group = np.unique(key.reshape(-1, 3), axis=0, return_inverse=True)
    total = np.zeros((int(group.max()) + 1, 3))
    np.add.at(total, group.reshape(-1), (angle * tangents).reshape(-1, 3))
    return _unit(total[group.reshape(-1)].reshape(-1, 3, 3)), hand


def in_tangent_space(shown: Texels) -> Callable[[FloatArray, slice], FloatArray]:
    """A function: normals (k, 3) in space, at some texels → unit normals in tangent space.

    The second axis is the direction in which v grows. As a viewer does, the interpolated tangent
    and normal are taken as they come, without making them orthogonal or of length 1.
    """
    normals = vertex_normals(shown.charted.mesh)
    tangents, hand = corner_tangents(shown.charted, normals)
    corner_normals = normals[shown.charted.mesh.faces]

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


def _unit(vectors: FloatArray) -> FloatArray:
    """Vectors of length 1; 0 stays."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, 1e-300))
