"""Seams, charts and packing of a map, and the faces that span a seam which the map does not have.

A neural map gives one uv to each vertex, so on a closed surface some faces bridge its learned cut:
their corners lie on both banks, and drawn in the plane they cross over others. The rule that finds
them, the same for every map: a UV edge between rows i and j is **spanning** if

1. it is longer than 1 % of L, the side of the square bounding box of the map (ParaPoint's T_cut),
2. its stretch, UV length over 3D length, exceeds 5 times that of its surroundings, and
3. its UV length exceeds 5 times what its surroundings would make of its 3D vector,

and a face is spanning if one of its edges is and it overlaps another face. The surroundings at an
end are the edges (2) or the Jacobians of the faces (3) there, by their lower quartile, of the two
ends the calmer one: so one sound bank suffices, and half of all edges at an end may cross the cut.
Condition 2 alone takes anisotropic faces (a pole, a Tutte map) for spanning, 3 alone thin faces
whose Jacobians are wild, both together a few of SLIM's where it squeezes a finger flat. With the
overlap no face of an injective map spans, however distorted: a face that bridges the gap of a cut
without crossing anything is part of such a map, and its distortion counts. On a sphere in
longitude and latitude the faces that bridge the date line span, and no others away from the poles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.metrics.distortion import Triangles, power_of_two
from benchmarks.metrics.overlap import Overlaps, covered_area
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

SPANNING_LENGTH = 0.01
"""Shortest spanning edge, in units of L: T_cut of ParaPoint."""
SPANNING_STRETCH = 5.0
"""How many times more a spanning edge is stretched than its surroundings."""
QUARTILE = 0.25
"""Which quantile stands for the surroundings."""


@dataclass(frozen=True, eq=False)
class Seams:
    """What the metrics of seams, charts and packing read.

    Attributes:
        mesh: the surface.
        parameterization: the map.
        triangles: its faces.
        overlaps: which of them overlap.
    """

    mesh: Mesh
    parameterization: Parameterization
    triangles: Triangles
    overlaps: Overlaps


def square_side(uv: FloatArray) -> float:
    """L: the side of the square bounding box of (T, 2) coordinates, 0 for none."""
    return float(np.ptp(uv, axis=0).max()) if len(uv) else 0.0


def chart_count(seams: Seams) -> float:
    """Number of charts."""
    return float(seams.parameterization.charts().max() + 1)


def seam_length(seams: Seams) -> float:
    """3D length of the cut, each seam edge once, / sqrt(total area); original boundary is none.

    inf for a cut surface without area.
    """
    start, end = seams.parameterization.seams(seams.mesh).T
    length = _lengths(seams.mesh.vertices[end] - seams.mesh.vertices[start]).sum()
    return _ratio(float(length), float(np.sqrt(seams.triangles.area.sum())))


def uv_boundary_length(seams: Seams) -> float:
    """UV length of all chart boundaries / sqrt(total UV area) (Shay et al.); inf without area."""
    uv, parameterization = seams.parameterization.uv, seams.parameterization
    start, end = parameterization.edges[parameterization.edge_face_count == 1].T
    length = float(_lengths(uv[end] - uv[start]).sum())
    return _ratio(length, float(np.sqrt(np.abs(seams.triangles.uv_area).sum())))


def packing_efficiency(seams: Seams) -> float:
    """UV area covered at least once / area of the square bounding box (Shay et al.).

    Exact where no faces overlap; the part under overlapping faces is integrated along scanlines
    (`overlap.covered_area`).
    """
    images = seams.parameterization.uv[seams.parameterization.corners]
    side = square_side(images.reshape(-1, 2))
    doubled = seams.overlaps.overlapped
    covered = np.abs(seams.triangles.uv_area[~doubled]).sum() + covered_area(images[doubled])
    return float(covered / side**2) if side > 0 else 0.0


def resolution(seams: Seams) -> float:
    """Largest 1/sigma2 with the map scaled into the unit square and the mesh as it is.

    The texels along a side of the texture that give every face one texel per unit length
    (Shay et al.). Faces degenerate in 3D take no part.
    """
    sigma2 = seams.triangles.sigma2[~seams.triangles.degenerate_3d]
    side = square_side(_used(seams.parameterization, seams.parameterization.uv))
    smallest = float(sigma2.min()) if len(sigma2) else 0.0
    return side / smallest if smallest > 0 else float("inf")


def _ratio(length: float, scale: float) -> float:
    return length / scale if scale > 0 else float("inf") if length > 0 else 0.0


def _lengths(vectors: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), dtype=np.float64)


def spanning_faces(
    mesh: Mesh, parameterization: Parameterization, overlapped: BoolArray
) -> BoolArray:
    """(F,) whether a face spans a seam, by the rule of this module.

    Args:
        mesh: the surface.
        parameterization: the map.
        overlapped: (F,) which faces overlap another.
    """
    if not overlapped.any():
        return overlapped
    spanning = spanning_edges(mesh, parameterization)[parameterization.edge_of_halfedge]
    return np.asarray(spanning.reshape(-1, 3).any(axis=1) & overlapped)


def spanning_edges(mesh: Mesh, parameterization: Parameterization) -> BoolArray:
    """(E,) whether an edge of `parameterization.edges` spans, by the rule of this module."""
    uv = parameterization.uv / power_of_two(parameterization.uv)
    edges, corners = parameterization.edges, parameterization.corners
    uv_length = _lengths(uv[edges[:, 1]] - uv[edges[:, 0]])
    spanning = uv_length > SPANNING_LENGTH * square_side(_used(parameterization, uv))
    # Only long edges need surroundings: few, unless the mesh is coarse.
    wanted = np.zeros(len(uv), dtype=bool)
    wanted[edges[spanning]] = True
    near = np.flatnonzero(wanted[edges].any(axis=1))
    vertices = mesh.vertices / power_of_two(mesh.vertices)
    vectors = _vectors(vertices, mesh, parameterization, near)
    length = _lengths(vectors)
    known = length > 0
    near, vectors, length = near[known], vectors[known], length[known]
    stretch = uv_length[near] / length
    ends = edges[near]
    usual_stretch = _lower_quartiles(ends.reshape(-1), np.repeat(stretch, 2), len(uv))
    torn = spanning[near] & (stretch > SPANNING_STRETCH * usual_stretch[ends].min(axis=1))
    usual = _usual_length(vertices[mesh.faces], uv, corners, ends[torn], vectors[torn])
    kept = uv_length[near[torn]] > SPANNING_STRETCH * usual
    spanning[:] = False
    spanning[near[torn][kept]] = True
    return np.asarray(spanning)


def _used(parameterization: Parameterization, uv: FloatArray) -> FloatArray:
    """The rows of `uv` that a face uses."""
    used = np.zeros(len(uv), dtype=bool)
    used[parameterization.corners] = True
    return uv[used]


def _vectors(
    vertices: FloatArray, mesh: Mesh, parameterization: Parameterization, chosen: IntArray
) -> FloatArray:
    """(C, 3) the 3D vectors of the chosen UV edges, from the smaller to the larger row."""
    halfedge = np.zeros(len(parameterization.edges), dtype=np.int64)
    halfedge[parameterization.edge_of_halfedge] = np.arange(3 * len(mesh.faces))
    start, end = mesh.halfedges[halfedge[chosen]].T
    row = parameterization.corners.reshape(-1)[halfedge[chosen]]
    forward = row == parameterization.edges[chosen, 0]
    vectors = vertices[end] - vertices[start]
    return np.asarray(np.where(forward[:, None], vectors, -vectors))


def _usual_length(
    points: FloatArray, uv: FloatArray, corners: IntArray, ends: IntArray, vectors: FloatArray
) -> FloatArray:
    """(C,) UV length that the Jacobians of the faces around give each candidate's 3D vector.

    Their lower quartile, of both ends the smaller one.

    Args:
        points: (F, 3, 3) corners of the faces.
        uv: (T, 2) rows.
        corners: (F, 3) row of each corner.
        ends: (C, 2) rows of uv that each candidate joins.
        vectors: (C, 3) its 3D vector.
    """
    rows = len(uv)
    wanted = np.zeros(rows, dtype=bool)
    wanted[ends] = True
    faces = np.flatnonzero(wanted[corners].any(axis=1))
    points, images = points[faces], uv[corners[faces]]
    a, b = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    normal = np.cross(a, b)
    squared = np.einsum("ij,ij->i", normal, normal)
    solid = squared > 0
    faces, a, b, normal, images = faces[solid], a[solid], b[solid], normal[solid], images[solid]
    # The gradients of the barycentric coordinates of corners 1 and 2 make J (N, 2, 3).
    gradient_a = np.cross(b, normal) / squared[solid, None]
    gradient_b = np.cross(normal, a) / squared[solid, None]
    jacobian = np.einsum("ni,nj->nij", images[:, 1] - images[:, 0], gradient_a)
    jacobian += np.einsum("ni,nj->nij", images[:, 2] - images[:, 0], gradient_b)

    # Faces by row: those at row r are face[first[r] : first[r] + count[r]].
    row = corners[faces].reshape(-1)
    face = np.argsort(row, kind="stable") // 3
    count = np.bincount(row, minlength=rows)
    first = np.cumsum(count) - count
    usual = np.full(len(ends), np.inf)
    for end in ends.T:
        candidate = np.repeat(np.arange(len(ends)), count[end])
        within = np.arange(len(candidate)) - np.repeat(
            np.cumsum(count[end]) - count[end], count[end]
        )
        around = face[first[end][candidate] + within]
        images = np.einsum("nij,nj->ni", jacobian[around], vectors[candidate])
        usual = np.minimum(usual, _lower_quartiles(candidate, _lengths(images), len(ends)))
    return usual


def _lower_quartiles(group: IntArray, values: FloatArray, groups: int) -> FloatArray:
    """(groups,) the lower quartile (the value at place floor((n - 1) / 4)) of each group's values.

    inf where a group has none.
    """
    ordered = values[np.lexsort((values, group))]
    count = np.bincount(group, minlength=groups)
    first = np.cumsum(count) - count
    quartiles = np.full(groups, np.inf)
    filled = count > 0
    place = first + np.floor(QUARTILE * (count - 1)).astype(np.int64)
    quartiles[filled] = ordered[place[filled]]
    return quartiles
