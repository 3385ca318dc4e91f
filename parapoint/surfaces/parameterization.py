"""Parameterizations: what a method returns."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from parapoint.errors import InputError
from parapoint.surfaces.places import places, same_place
from parapoint.surfaces.surface import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    edge_components,
    edge_table,
    read_only,
)


class TracePoint(NamedTuple):
    """The state of an iterative method after `iteration` steps, for convergence curves.

    Attributes:
        iteration: steps done.
        seconds: time since the method began.
        values: energy or loss terms by name.
        uv: (T, 2) the map at this step, rows as in the result, or None where it was not kept.
    """

    iteration: int
    seconds: float
    values: Mapping[str, float]
    uv: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class Parameterization:
    """A map of a mesh to the plane, one uv for each face corner, indexed as in an OBJ file.

    Attributes:
        uv: (T, 2) float64 coordinates, finite; a row of two NaN is a place that the map leaves out.
        corners: (F, 3) int64: corner k of face f lies at `uv[corners[f, k]]`. Faces are in the
            order of the mesh. A seam is where the two faces at an edge use different rows.
        trace: states on the way there, if the method keeps them.
        report: what the method wants written beside its result (energies, iterations, weights).

    Raises:
        InputError: a shape, a value or an index is not as said.
    """

    uv: FloatArray
    corners: IntArray
    trace: tuple[TracePoint, ...] = ()
    report: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        uv = _uv_rows(self.uv)
        corners = read_only(self.corners, np.int64, "corners", 3)
        if len(corners) and (corners.min() < 0 or corners.max() >= len(uv)):
            raise InputError(f"corners must be rows of uv, which run from 0 to {len(uv) - 1}")
        object.__setattr__(self, "uv", uv)
        object.__setattr__(self, "corners", corners)

    @property
    def covered(self) -> BoolArray:
        """(F,) whether the map has a place for all corners of each face."""
        known: BoolArray = np.asarray(np.isfinite(self.uv).all(axis=1))
        return np.asarray(known[self.corners].all(axis=1))

    @cached_property
    def _edge_table(self) -> tuple[IntArray, IntArray, IntArray]:
        """UV edges (E, 2), the edge of each halfedge (3F,), halfedges at each edge (E,)."""
        return edge_table(self.corners)

    @property
    def edges(self) -> IntArray:
        """(E, 2) undirected UV edges: pairs of rows of `uv`, smaller row first."""
        return self._edge_table[0]

    @property
    def edge_of_halfedge(self) -> IntArray:
        """(3F,) row of `edges` for each halfedge, ordered as `Mesh.halfedges`."""
        return self._edge_table[1]

    @property
    def edge_face_count(self) -> IntArray:
        """(E,) number of faces at each UV edge: 1 on the boundary of a chart, 2 inside."""
        return self._edge_table[2]

    @cached_property
    def _charts(self) -> IntArray:
        return edge_components(self.corners)

    def charts(self) -> IntArray:
        """(F,) the chart of each face: faces that share a UV edge (two rows of `uv`) are in one.

        Charts are numbered from 0 in the order of their first faces.
        """
        return self._charts

    def shared_at(self, faces: IntArray) -> Parameterization:
        """This map with one row of uv for all corners of `faces` (F, 3) of one vertex and uv."""
        uv = self.uv[self.corners.reshape(-1)]
        in_the_plane = places(uv, same_place(uv))
        row = places(np.stack([faces.reshape(-1), in_the_plane], axis=1))
        shared = np.empty((int(row.max()) + 1, 2))
        shared[row] = uv
        return Parameterization(shared, row.reshape(-1, 3))

    def seams(self, mesh: Mesh) -> IntArray:
        """(S, 2) interior edges of `mesh` along which the map is cut, smaller vertex first.

        An edge with two faces is a seam unless both use the same two rows of `uv` there. In
        general it is one where a face at it lies at the border of its chart: at the pole of a
        globe, whose triangles without area join the charts' faces in the plane, nothing is cut.

        Raises:
            InputError: the mesh has another number of faces.
        """
        if len(mesh.faces) != len(self.corners):
            raise InputError(
                f"{len(self.corners)} corner rows for a mesh of {len(mesh.faces)} faces"
            )
        is_border = self.edge_face_count[self.edge_of_halfedge] == 1
        is_inner = mesh.edge_face_count[mesh.edge_of_halfedge] > 1
        is_inner &= mesh.halfedges[:, 0] != mesh.halfedges[:, 1]
        cut = np.unique(mesh.edge_of_halfedge[is_border & is_inner])
        return np.asarray(mesh.edges[cut], dtype=np.int64)


class Charted(NamedTuple):
    """A mesh with a map of it.

    Attributes:
        mesh: the mesh.
        map: its map, with a row of corners for each of its faces.
    """

    mesh: Mesh
    map: Parameterization

    def welded(self) -> Charted:
        """The same with one vertex at each place, and one uv where several agree there."""
        mesh = self.mesh.welded
        if np.array_equal(mesh.faces, self.mesh.faces):
            return self
        return Charted(mesh, self.map.shared_at(mesh.faces))

    def turned(self) -> Charted:
        """The other side up: faces turned round, and the plane mirrored, so that none flips."""
        uv = self.map.uv * [-1.0, 1.0]
        faces, corners = self.mesh.faces[:, ::-1], self.map.corners[:, ::-1]
        return Charted(Mesh(self.mesh.vertices, faces), Parameterization(uv, corners))


@dataclass(frozen=True, eq=False)
class PointParameterization:
    """A map of a point cloud to the plane.

    Attributes:
        uv: (P, 2) float64 coordinates, one row a point, finite; a row of two NaN is a point that
            the map leaves out, such as a stray one.
        trace: states on the way there, if the method keeps them.
        report: what the method wants written beside its result.

    Raises:
        InputError: a shape or a value is not as said.
    """

    uv: FloatArray
    trace: tuple[TracePoint, ...] = ()
    report: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "uv", _uv_rows(self.uv))

    @property
    def covered(self) -> BoolArray:
        """(P,) whether the map has a place for each point."""
        return np.asarray(np.isfinite(self.uv).all(axis=1))


def _uv_rows(values: object) -> FloatArray:
    """A read-only copy of (T, 2) coordinates, whose rows are finite or of two NaN.

    Raises:
        InputError: the shape is another, or a row is neither.
    """
    left_out: BoolArray = np.zeros(0, dtype=bool)
    with contextlib.suppress(TypeError, ValueError, OverflowError):
        array = np.array(values, dtype=np.float64)
        if array.ndim == 2:
            left_out = np.asarray(np.isnan(array).all(axis=1))
            values = np.where(left_out[:, None], 0.0, array)
    uv: FloatArray = read_only(values, np.float64, "uv", 2)
    if left_out.any():
        uv = np.where(left_out[:, None], np.nan, uv)
        uv.setflags(write=False)
    return uv
