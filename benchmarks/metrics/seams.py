"""Seams, charts and packing of a map, and the faces that span a seam.

A neural map gives one uv to each vertex, so it cannot show the cut of a closed surface as a seam.
Instead some faces span it: their corners lie on both sides of the cut, and in the plane they are
drawn across other faces. One rule finds them in every map. An edge of the map is **spanning** if

1. it is longer than 1 % of L, the side of the square bounding box of the map (ParaPoint's T_cut),
2. its stretch, UV length over 3D length, is more than 5 times the stretch of the edges around it,
3. and its UV length is more than 5 times the length that the faces around it would give it, that
   is, to which their Jacobians map its 3D vector.

Around an edge means at one of its ends, at the end where the lower quartile of these values is
smaller. So it is enough that one side of the cut is sound, and half of the edges there may cross
it. A face is **spanning** if it has a spanning edge and overlaps another face.

Each condition has its reason. The second alone would accept anisotropic faces, as at a pole or in
Tutte's embedding; the third alone would accept faces next to thin ones, whose Jacobians are wild;
and both together would accept a few faces where SLIM squeezes a finger flat. The overlap rules all
of these out: no face of a one-to-one map spans a seam, however distorted it is. A face that bridges
a cut and crosses nothing is a part of the map, and its distortion counts. On a sphere mapped by
longitude and latitude, the faces across the date line span it, and no others away from the poles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.metrics.distortion import Triangles, lengths, power_above
from benchmarks.metrics.overlap import Overlaps, covered_area
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

SPANNING_LENGTH = 0.01
"""UV length above which an edge may span a seam, in units of L: T_cut of ParaPoint."""
SPANNING_STRETCH = 5.0
"""A spanning edge is stretched more than this many times as much as what is around it."""
QUARTILE = 0.25
"""The quantile, from 0 to 1, of the stretches around an edge that its own is compared with."""


@dataclass(frozen=True, eq=False)
class Seams:
    """What the metrics of seams, charts and packing read.

    Attributes:
        mesh: the surface.
        parameterization: the map.
        triangles: its faces, measured.
        overlaps: which of the faces overlap.
    """

    mesh: Mesh
    parameterization: Parameterization
    triangles: Triangles
    overlaps: Overlaps


def square_side(uv: FloatArray) -> float:
    """L, the side of the square bounding box of (T, 2) coordinates; 0 if there are none."""
    return float(np.ptp(uv, axis=0).max()) if len(uv) else 0.0


def chart_count(seams: Seams) -> float:
    """Number of charts."""
    return float(seams.parameterization.charts().max() + 1)


def seam_length(seams: Seams) -> float:
    """3D length of the cut, each of its edges counted once, over the root of the total area.

    The boundary of the surface is no part of the cut. inf where a surface without area is cut.
    """
    start, end = seams.parameterization.seams(seams.mesh).T
    length = lengths(seams.mesh.vertices[end] - seams.mesh.vertices[start]).sum()
    return _ratio(float(length), float(np.sqrt(seams.triangles.area.sum())))


def uv_boundary_length(seams: Seams) -> float:
    """UV length of all chart boundaries over the root of the UV area (Shay et al.); inf without."""
    uv, parameterization = seams.parameterization.uv, seams.parameterization
    start, end = parameterization.edges[parameterization.edge_face_count == 1].T
    length = float(lengths(uv[end] - uv[start]).sum())
    return _ratio(length, float(np.sqrt(np.abs(seams.triangles.uv_area).sum())))


def packing_efficiency(seams: Seams) -> float:
    """UV area that is covered at least once, over that of the square bounding box (Shay et al.).

    It is exact where no faces overlap. The area under faces that do is integrated along scanlines
    (`overlap.covered_area`).
    """
    images = seams.parameterization.uv[seams.parameterization.corners]
    side = square_side(images.reshape(-1, 2))
    doubled = seams.overlaps.overlapped
    covered = np.abs(seams.triangles.uv_area[~doubled]).sum() + covered_area(images[doubled])
    return float(covered / side**2) if side > 0 else 0.0


def resolution(seams: Seams) -> float:
    """Texels along a side of the texture that give every face one texel per unit of length.

    This is the largest 1/sigma2 of the map scaled into the unit square, with the mesh in its own
    unit (Shay et al.). Faces that are degenerate in 3D are left out.
    """
    sigma2 = seams.triangles.sigma2[~seams.triangles.degenerate_3d]
    side = square_side(_used(seams.parameterization, seams.parameterization.uv))
    smallest = float(sigma2.min()) if len(sigma2) else 0.0
    return side / smallest if smallest > 0 else float("inf")


def _ratio(length: float, scale: float) -> float:
    return length / scale if scale > 0 else float("inf") if length > 0 else 0.0


def spanning_faces(
    mesh: Mesh, parameterization: Parameterization, overlapped: BoolArray
) -> BoolArray:
    """(F,) whether a face spans a seam, by the rule at the head of this file.

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
    """(E,) whether an edge of `parameterization.edges` is spanning, by the same rule."""
    uv = parameterization.uv / power_above(parameterization.uv)
    edges, corners = parameterization.edges, parameterization.corners
    uv_length = lengths(uv[edges[:, 1]] - uv[edges[:, 0]])
    spanning = uv_length > SPANNING_LENGTH * square_side(_used(parameterization, uv))
    # Only what is around long edges is looked at; these are few, unless the mesh is coarse.
    wanted = np.zeros(len(uv), dtype=bool)
    wanted[edges[spanning]] = True
    near = np.flatnonzero(wanted[edges].any(axis=1))
    vertices = mesh.vertices / power_above(mesh.vertices)
    vectors = _vectors(vertices, mesh, parameterization, near)
    length = lengths(vectors)
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
    """(C,) the UV length that the faces around an edge would give it.

    Each Jacobian of a face at one end of the edge maps its 3D vector to a UV length; this is the
    lower quartile of these lengths, at the end where it is smaller.

    Args:
        points: (F, 3, 3) the corners of the faces in space.
        uv: (T, 2) rows of uv.
        corners: (F, 3) the row of uv of each corner.
        ends: (C, 2) the rows of uv that each edge joins.
        vectors: (C, 3) the 3D vector of each edge.
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
    # J (N, 2, 3) is the sum over corners 1 and 2 of the UV side to the corner times the gradient of
    # the barycentric coordinate of the corner.
    gradient_a = np.cross(b, normal) / squared[solid, None]
    gradient_b = np.cross(normal, a) / squared[solid, None]
    jacobian = np.einsum("ni,nj->nij", images[:, 1] - images[:, 0], gradient_a)
    jacobian += np.einsum("ni,nj->nij", images[:, 2] - images[:, 0], gradient_b)

    # The faces at row r of uv are face[first[r] : first[r] + count[r]].
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
        usual = np.minimum(usual, _lower_quartiles(candidate, lengths(images), len(ends)))
    return usual


def _lower_quartiles(group: IntArray, values: FloatArray, groups: int) -> FloatArray:
    """(groups,) the lower quartile of the values of each group; inf where a group has none.

    Of n values in order it is the one at place floor((n - 1) / 4), counted from 0.
    """
    ordered = values[np.lexsort((values, group))]
    count = np.bincount(group, minlength=groups)
    first = np.cumsum(count) - count
    quartiles = np.full(groups, np.inf)
    filled = count > 0
    place = first + np.floor(QUARTILE * (count - 1)).astype(np.int64)
    quartiles[filled] = ordered[place[filled]]
    return quartiles
