"""Surfaces: triangle meshes and point clouds, validated once, with their topology."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import igl
import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.errors import InputError
from parapoint.surfaces.places import first_of_each, places, same_place

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

SHORT = 1e-3
"""Vertices are at one place only if they are nearer than this share of the median edge, too: small
things that lie far apart in one file keep their vertices."""


def read_only(values: Any, dtype: type[np.generic], name: str, columns: int) -> npt.NDArray[Any]:
    """A read-only C-contiguous copy of `values` as a finite (n, columns) array.

    Raises:
        InputError: `values` has another shape, is not numeric, or holds NaN or infinite entries.
    """
    try:
        array = np.array(values, dtype=dtype, order="C")
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(f"{name} must be numbers of shape (n, {columns}): {error}") from None
    if array.ndim != 2 or array.shape[1] != columns:
        raise InputError(f"{name} must have shape (n, {columns}), not {array.shape}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        row = int(np.flatnonzero(~np.isfinite(array).all(axis=1))[0])
        raise InputError(f"{name} must be finite; row {row} is {array[row].tolist()}")
    array.setflags(write=False)
    return array


def edge_table(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The undirected edges of triangles, whose corners are any non-negative integers.

    Args:
        triangles: (F, 3); halfedge 3f + k runs from corner k to corner k + 1 of triangle f.

    Returns:
        Edges (E, 2), smaller end first, in lexicographic order; the edge of each halfedge (3F,);
        the number of halfedges at each edge (E,).
    """
    start, end = triangles.reshape(-1), np.roll(triangles, -1, axis=1).reshape(-1)
    # One integer an edge sorts ten times as fast as rows of two do.
    base = int(triangles.max(initial=0)) + 1
    key, edge_of_halfedge, count = np.unique(
        np.minimum(start, end) * base + np.maximum(start, end),
        return_inverse=True,
        return_counts=True,
    )
    edges = np.stack(np.divmod(key, base), axis=1)
    return edges, edge_of_halfedge.reshape(-1).astype(np.int64), count.astype(np.int64)


def twin_halfedges(edge_of_halfedge: IntArray) -> tuple[IntArray, IntArray]:
    """(P,) and (P,) rows of halfedges (3F,) of one edge, by edge; P the inner edges of a manifold.

    Of an edge with more than two, each after the first is the twin of the one before.
    """
    order = np.argsort(edge_of_halfedge, kind="stable")
    is_twin = np.diff(edge_of_halfedge[order]) == 0
    return order[:-1][is_twin], order[1:][is_twin]


def flat_faces(vertices: FloatArray, faces: IntArray) -> BoolArray:
    """(F,) which triangles have no area beyond rounding: no cotangent, gradient or normal."""
    double_area, relative = igl.doublearea(vertices, faces), 8 * np.finfo(np.float64).eps
    flat = double_area <= relative * 3 * np.ptp(vertices) ** 2  # no edge is as long as that
    suspects = np.flatnonzero(flat)
    longest = igl.squared_edge_lengths(vertices, faces[suspects]).max(axis=1, initial=0)
    flat[suspects] = double_area[suspects] <= relative * longest
    return np.asarray(flat, dtype=bool)


def unit_normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """(T, 3) unit normals of triangles (T, 3); 0 of those without area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


def edge_components(triangles: IntArray) -> IntArray:
    """(F,) the component, from 0, of each of (F, 3) triangles; those that share an edge are in one.

    Components are numbered in the order of their first triangles.
    """
    if not len(triangles):
        return np.zeros(0, dtype=np.int64)
    edges, edge, _ = edge_table(triangles)
    triangle = np.repeat(np.arange(len(triangles)), 3)
    # Triangles and their edges as one graph: a path between two runs through shared edges.
    size = len(triangles) + len(edges)
    graph = sparse.coo_matrix(
        (np.ones(len(triangle), dtype=bool), (triangle, len(triangles) + edge)), (size, size)
    )
    label = csgraph.connected_components(graph, directed=False)[1][: len(triangles)]
    return np.asarray(label, dtype=np.int64)


def turned_faces(triangles: IntArray) -> BoolArray:
    """(F,) the triangles to turn so that neighbours turn alike: the fewer of each component."""
    turned, patch = igl.bfs_orient(triangles)
    is_turned = (turned != triangles).any(axis=1)
    most = 2 * np.bincount(patch, is_turned) > np.bincount(patch)
    return np.asarray(is_turned ^ most[patch], dtype=bool)


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    Attributes:
        vertices: (V, 3) float64 positions, finite. Unreferenced and duplicate vertices are kept.
        faces: (F, 3) int64 rows of `vertices`, at least one face.
        seams: (S, 2) int64, edges along which a map that came with the mesh is cut; None if none
            came. Only a method that `requires` seams looks at them.

    Raises:
        InputError: a shape, a value or an index is not as said.
    """

    vertices: FloatArray
    faces: IntArray
    seams: IntArray | None = None

    def __post_init__(self) -> None:
        vertices = read_only(self.vertices, np.float64, "vertices", 3)
        faces = read_only(self.faces, np.int64, "faces", 3)
        if len(faces) == 0:
            raise InputError("a mesh needs at least one face; a point cloud may have none")
        if faces.min() < 0 or faces.max() >= len(vertices):
            row = int(np.flatnonzero(((faces < 0) | (faces >= len(vertices))).any(axis=1))[0])
            raise InputError(
                f"face {row} is {faces[row].tolist()}, "
                f"but vertices run from 0 to {len(vertices) - 1}"
            )
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)
        if self.seams is not None:
            object.__setattr__(self, "seams", read_only(self.seams, np.int64, "seams", 2))

    @cached_property
    def halfedges(self) -> IntArray:
        """(3F, 2) directed edges; row 3f + k runs from corner k to corner k + 1 of face f."""
        return np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2)

    @cached_property
    def _edge_table(self) -> tuple[IntArray, IntArray, IntArray]:
        """Undirected edges (E, 2), the edge of each halfedge (3F,), faces at each edge (E,)."""
        return edge_table(self.faces)

    @property
    def edges(self) -> IntArray:
        """(E, 2) undirected edges, smaller vertex first."""
        return self._edge_table[0]

    @property
    def edge_of_halfedge(self) -> IntArray:
        """(3F,) row of `edges` for each row of `halfedges`."""
        return self._edge_table[1]

    @property
    def edge_face_count(self) -> IntArray:
        """(E,) number of faces at each edge: 1 on the boundary, 2 inside."""
        return self._edge_table[2]

    @cached_property
    def boundary_loops(self) -> list[IntArray]:
        """Ordered vertices of each boundary loop, longest (in 3D length) first."""
        loops = [np.asarray(loop, dtype=np.int64) for loop in igl.boundary_loop_all(self.faces)]

        def length(loop: IntArray) -> float:
            points = self.vertices[loop]
            return float(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum())

        return sorted(loops, key=length, reverse=True)

    @cached_property
    def referenced(self) -> BoolArray:
        """(V,) whether any face uses the vertex."""
        mask = np.zeros(len(self.vertices), dtype=bool)
        mask[self.faces] = True
        return mask

    @property
    def euler_characteristic(self) -> int:
        """Referenced vertices - edges + faces."""
        return int(self.referenced.sum()) - len(self.edges) + len(self.faces)

    @cached_property
    def place(self) -> IntArray:
        """(V,) the first of all vertices that lie at the place of each, as `places` tells them."""
        ends = self.vertices[self.edges]
        typical = float(np.median(np.abs(ends[:, 0] - ends[:, 1]).max(axis=1)))
        tolerance = min(same_place(self.vertices[self.referenced]), SHORT * typical)
        return first_of_each(places(self.vertices, tolerance))

    @cached_property
    def welded(self) -> Mesh:
        """This mesh with every face at the first of the vertices at each place."""
        return Mesh(self.vertices, self.place[self.faces])

    @cached_property
    def face_components(self) -> IntArray:
        """(F,) connected component of each face; faces that share a vertex are connected."""
        i, j = self.edges.T
        size = len(self.vertices)
        graph = sparse.coo_matrix((np.ones(len(i), dtype=bool), (i, j)), shape=(size, size))
        _, label = csgraph.connected_components(graph, directed=False)
        return (
            np.unique(label[self.faces[:, 0]], return_inverse=True)[1].reshape(-1).astype(np.int64)
        )

    @property
    def component_count(self) -> int:
        """Number of connected components, unreferenced vertices apart."""
        return int(self.face_components.max()) + 1

    @cached_property
    def is_manifold(self) -> bool:
        """At most two faces at each edge, one fan at each vertex, no vertex twice in a face."""
        repeated = (self.faces == np.roll(self.faces, 1, axis=1)).any()
        if repeated or (self.edge_face_count > 2).any():
            return False
        return bool(
            igl.is_vertex_manifold(self.faces)[self.referenced[: self.faces.max() + 1]].all()
        )

    @cached_property
    def is_oriented(self) -> bool:
        """No directed edge stands twice: neighbouring faces turn the same way."""
        return len(np.unique(self.halfedges, axis=0)) == len(self.halfedges)

    @property
    def is_connected_surface(self) -> bool:
        """Connected, manifold and consistently oriented: what can be cut to a disk."""
        return self.is_manifold and self.is_oriented and self.component_count == 1

    @property
    def is_planar_domain(self) -> bool:
        """Whether it is a disk, with or without holes: it embeds in the plane without a cut."""
        return self.is_connected_surface and len(self.boundary_loops) > 0 and self.genus == 0

    @property
    def genus(self) -> int:
        """Number of handles of a connected, manifold, oriented surface."""
        return (2 - self.euler_characteristic - len(self.boundary_loops)) // 2

    @cached_property
    def topology(self) -> str:
        """The topology in words: "disk", "sphere", "genus 0 with 11 boundary loops", ..."""
        if not self.is_manifold:
            return "not manifold"
        if not self.is_oriented:
            return "manifold, faces not consistently oriented"
        if self.component_count > 1:
            return f"{self.component_count} components"
        loops = len(self.boundary_loops)
        if self.genus == 0 and loops < 2:
            return "disk" if loops else "sphere"
        boundary = f"{loops} boundary loop{'s' * (loops != 1)}" if loops else "no boundary"
        return f"genus {self.genus} with {boundary}"

    @cached_property
    def face_areas(self) -> FloatArray:
        """(F,) triangle areas."""
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2, dtype=np.float64)


def compact(vertices: FloatArray, faces: IntArray) -> Mesh:
    """The mesh of these faces (F, 3), with their vertices alone, in the same order."""
    used, rows = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], rows.reshape(-1, 3))


def vertex_normals(mesh: Mesh) -> FloatArray:
    """(V, 3) unit normals of the vertices, the means of the faces around by area; or 0."""
    normals = np.zeros(mesh.vertices.shape)
    by_face = mesh.face_areas[:, None] * unit_normals(mesh.vertices, mesh.faces)
    for corner in mesh.faces.T:
        np.add.at(normals, corner, by_face)
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300))


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points on a surface.

    Attributes:
        points: (P, 3) float64 positions, finite, at least one.
        normals: (P, 3) float64 normals, or None.
        dropped: rows that were left out before, as they were not finite; for reports.
        attributes: whatever else is known at each point, by name: (P,) or (P, k) numbers of any
            type. "colours" are (P, 3) or (P, 4) sRGB values, uint8, uint16, or floats from 0 to 1,
            NaN where a point has none;
            "intensity" is (P,).
        rows: (P,) row of each point, from 0, in the file or array that the cloud comes from; None
            where all rows of that are there.

    Raises:
        InputError: a shape or a value is not as said.
    """

    points: FloatArray
    normals: FloatArray | None = None
    dropped: int = 0
    attributes: Mapping[str, npt.NDArray[Any]] = field(default_factory=dict)
    rows: IntArray | None = None

    def __post_init__(self) -> None:
        points = read_only(self.points, np.float64, "points", 3)
        if len(points) == 0:
            raise InputError("a point cloud needs at least one point")
        object.__setattr__(self, "points", points)
        if self.normals is not None:
            normals = read_only(self.normals, np.float64, "normals", 3)
            if len(normals) != len(points):
                raise InputError(f"{len(normals)} normals for {len(points)} points")
            object.__setattr__(self, "normals", normals)
        given = {name: _attribute(name, of, len(points)) for name, of in self.attributes.items()}
        object.__setattr__(self, "attributes", MappingProxyType(given))
        if self.rows is not None and self.rows.shape != (len(points),):
            raise InputError(f"{len(self.rows)} row numbers for {len(points)} points")

    def chosen(self, which: BoolArray) -> PointCloud:
        """Some of the points (P,), with all that is known of them."""
        normals = None if self.normals is None else self.normals[which]
        attributes = {name: values[which] for name, values in self.attributes.items()}
        rows = self.rows_of(np.flatnonzero(which))
        return PointCloud(self.points[which], normals, self.dropped, attributes, rows)

    def rows_of(self, places: IntArray) -> IntArray:
        """The rows, in the file or array that was given, of the points at these places (n,)."""
        return places if self.rows is None else self.rows[places]


def _attribute(name: str, values: Any, count: int) -> npt.NDArray[Any]:
    """A read-only view of one attribute of `count` points.

    Raises:
        InputError: it has another length, or is no array of numbers; colours are no colours.
    """
    array = np.asarray(values).view()
    if array.ndim not in (1, 2) or array.dtype.kind not in "biuf":
        raise InputError(f"{name} must be numbers of shape (n,) or (n, k), not {array.shape}")
    if len(array) != count:
        raise InputError(f"{len(array)} {name} for {count} points")
    if name == "colours":
        if array.ndim != 2 or array.shape[1] not in (3, 4):
            raise InputError(f"colours must have shape (n, 3) or (n, 4), not {array.shape}")
        if array.dtype.kind != "f" and array.dtype not in (np.uint8, np.uint16):
            raise InputError(f"colours must be uint8, uint16 or floats, not {array.dtype}")
        if array.dtype.kind == "f" and not (((array >= 0) & (array <= 1)) | np.isnan(array)).all():
            raise InputError("colours that are floats must lie between 0 and 1")
    array.setflags(write=False)
    return array


Surface = Mesh | PointCloud
