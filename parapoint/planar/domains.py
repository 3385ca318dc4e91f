"""What the methods for disks share: their domain, boundary curves, and checks."""

from __future__ import annotations

from typing import NamedTuple

import igl
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface, flat_faces

ROUNDING = 1e-8
"""Squared distances that differ by no more than this share count as the same."""


class FlatteningError(RuntimeError):
    """A method ran on a surface it supports and found no map; the message says why."""


class Domain(NamedTuple):
    """A disk, with or without holes, without the vertices that no face uses.

    Attributes:
        vertices: (V, 3) referenced vertices; libigl's systems are singular with others.
        faces: (F, 3) rows of `vertices`, faces and corners in the order of the mesh.
        loop: (B,) the longest boundary loop, in the direction of the faces' edges.
        area: 3D area.
    """

    vertices: FloatArray
    faces: IntArray
    loop: IntArray
    area: float


def domain(surface: Surface) -> Domain:
    """The domain of a disk method.

    Raises:
        UnsupportedError: the surface is no disk, with or without holes.
    """
    if not isinstance(surface, Mesh):
        raise UnsupportedError("needs faces; the surface is a point cloud")
    if not surface.is_planar_domain:
        raise UnsupportedError(f"needs a disk; the surface is {surface.topology}")
    vertices, faces, loop = surface.vertices, surface.faces, surface.boundary_loops[0]
    if not surface.referenced.all():
        row = np.cumsum(surface.referenced) - 1
        vertices, faces, loop = vertices[surface.referenced], row[faces], row[loop]
    a, b, c = faces.T
    along = any(((i == loop[0]) & (j == loop[1])).any() for i, j in ((a, b), (b, c), (c, a)))
    area = float(igl.doublearea(vertices, faces).sum()) / 2
    return Domain(vertices, faces, loop if along else loop[::-1], area)


def closed_holes(disk: Domain) -> tuple[FloatArray, IntArray]:
    """Vertices and faces of the domain, each loop but the longest closed by a fan around its mean.

    The rows of the domain come first.
    """
    halfedges = np.stack([disk.faces, np.roll(disk.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    size = len(disk.vertices)
    open_ends = halfedges[~np.isin(halfedges @ [size, 1], halfedges @ [1, size])]
    inner = open_ends[~np.isin(open_ends[:, 0], disk.loop)]
    graph = sparse.coo_matrix((np.ones(len(inner), dtype=bool), tuple(inner.T)), (size, size))
    _, label = csgraph.connected_components(graph, directed=False)
    _, hole = np.unique(label[inner[:, 0]], return_inverse=True)
    count = np.bincount(hole)[:, None]
    centres = np.zeros((len(count), 3))
    np.add.at(centres, hole, disk.vertices[inner[:, 0]])
    fans = np.stack([inner[:, 1], inner[:, 0], size + hole], axis=1)
    return np.concatenate([disk.vertices, centres / count]), np.concatenate([disk.faces, fans])


def check_triangles(vertices: FloatArray, faces: IntArray) -> None:
    """Raise where a triangle has no area: its cotangents and gradients are undefined.

    Raises:
        InputError: names the first such face and their number.
    """
    flat = flat_faces(vertices, faces)
    if flat.any():
        raise InputError(
            f"face {int(flat.argmax())} has no area (one of {int(flat.sum())} such faces): "
            f"collapse or remove them first; of the methods for disks only tutte takes them"
        )


def arc_lengths(points: FloatArray) -> FloatArray:
    """(B,) length of each edge of a closed polygon (B, 3), from a point to the next."""
    return np.asarray(
        np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1), dtype=np.float64
    )


def circle(points: FloatArray) -> FloatArray:
    """(B, 2) points on the unit circle, spaced as the closed polygon `points` (B, 3) is long."""
    lengths = arc_lengths(points)
    angle = 2 * np.pi * (np.cumsum(lengths) - lengths) / lengths.sum()
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def far_pair(points: FloatArray) -> tuple[int, int]:
    """Rows of two far points of (B, 3): the farthest from the mean, and the farthest from that one.

    Of several that are equally far up to rounding, the first.
    """
    one = _farthest(points, points.mean(axis=0))
    return one, _farthest(points, points[one])


def _farthest(points: FloatArray, origin: FloatArray) -> int:
    squared = ((points - origin) ** 2).sum(axis=1)
    return int((squared >= (1 - ROUNDING) * squared.max()).argmax())


def finite(uv: FloatArray) -> FloatArray:
    """`uv` (V, 2) unchanged, once it is known to be finite.

    Raises:
        FlatteningError: `uv` is not finite.
    """
    if not np.isfinite(uv).all():
        raise FlatteningError("the linear system is singular: its solution is not finite")
    return uv


def scaled(disk: Domain, uv: FloatArray) -> FloatArray:
    """`uv` (V, 2) scaled to the 3D area of the domain.

    Raises:
        FlatteningError: `uv` is not finite, or has no area.
    """
    area = float(np.abs(signed_areas(finite(uv), disk.faces)).sum())
    if area <= 0:
        raise FlatteningError("the map collapsed: its area is zero")
    return np.asarray(uv * np.sqrt(disk.area / area), dtype=np.float64)


def frames(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(F, 2, 2) for each triangle, the inverse of its two edges from corner 0 in its own plane."""
    first, second = (vertices[faces[:, k]] - vertices[faces[:, 0]] for k in (1, 2))
    length = np.linalg.norm(first, axis=1)
    along = (first * second).sum(axis=1) / length
    height = np.linalg.norm(np.cross(first, second), axis=1) / length
    zero = np.zeros_like(length)
    inverse = [1 / length, -along / (length * height), zero, 1 / height]
    return np.stack(inverse, axis=1).reshape(-1, 2, 2)


def singular_values(
    frame: FloatArray, uv: FloatArray, faces: IntArray
) -> tuple[FloatArray, FloatArray]:
    """(F,), (F,) singular values of each triangle's Jacobian; the second is negative if flipped."""
    edges = np.stack([uv[faces[:, k]] - uv[faces[:, 0]] for k in (1, 2)], axis=2)
    (a, b), (c, d) = (edges @ frame).transpose(1, 2, 0)
    turn, shear = np.hypot(a + d, c - b) / 2, np.hypot(a - d, c + b) / 2
    return turn + shear, turn - shear


def check_iterations(iterations: int) -> None:
    """Raise where a method is to do no step.

    Raises:
        InputError: `iterations` is less than 1.
    """
    if iterations < 1:
        raise InputError(f"iterations must be at least 1, not {iterations}")


def is_kept(iteration: int, last: int) -> bool:
    """Whether a trace keeps the map at this step: 1, 2, 5, 10, 20, 50, ... and the last one."""
    return iteration == last or str(iteration).rstrip("0") in {"1", "2", "5"}
