"""The lid of a surface: a large side between creases, such as that of a plate or a box."""

from __future__ import annotations

import igl
import numpy as np

from parapoint.surfaces.cutting import cut_along, disk_cut, edge_lengths, edge_mask, origin
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, edge_components

CREASE = np.radians(30)
"""Angle between the normals of two faces, in radians, above which their edge is a crease."""
SMALLEST_LID, LARGEST_LID = 0.1, 0.5
"""Share of the surface that a lid has. To open a smaller side helps little; around a larger one it
is the rest that would have to be opened."""
ALIKE = 1e-6
"""Share of the largest area by which a side may be smaller and still count as the largest, so that
rounding decides nothing; and so for the lengths of edges."""


def lid_cut(mesh: Mesh) -> BoolArray:
    """(E,) the edges along which a mesh opens around its lid, its largest side; none without a lid.

    The lid stays joined to each part of the rest by the longest edge between the two. Where this is
    no planar domain yet, it is cut on (`parapoint.surfaces.cutting.disk_cut`).

    Args:
        mesh: connected, manifold, consistently oriented.
    """
    creases = igl.sharp_edges(mesh.vertices, mesh.faces, CREASE)
    side = edge_components(cut_along(mesh, creases).faces)
    share = np.bincount(side, mesh.face_areas) / mesh.face_areas.sum()
    share[share > LARGEST_LID] = 0
    lid = _largest(share)
    if share[lid] < SMALLEST_LID:
        return np.zeros(len(mesh.edges), dtype=bool)
    is_between = np.bincount(mesh.edge_of_halfedge, np.repeat(side == lid, 3)) == 1
    rim = is_between & (mesh.edge_face_count == 2)
    part = edge_components(cut_along(mesh, mesh.edges[rim]).faces)
    beside = np.bincount(mesh.edge_of_halfedge, np.repeat(part, 3)) - part[side == lid][0]
    lengths = edge_lengths(mesh)
    cut = rim.copy()
    for other in np.unique(beside[rim]):
        shared = np.flatnonzero(rim & (beside == other))
        cut[shared[_largest(lengths[shared])]] = False
    opened = cut_along(mesh, mesh.edges[cut])
    if not opened.is_planar_domain:
        more = opened.edges[disk_cut(opened)]
        cut |= edge_mask(mesh, origin(mesh, opened)[more])
    return np.asarray(cut, dtype=bool)


def _largest(sizes: FloatArray) -> int:
    """The first of the largest sizes (n,), up to rounding."""
    return int((sizes >= (1 - ALIKE) * sizes.max()).argmax())
