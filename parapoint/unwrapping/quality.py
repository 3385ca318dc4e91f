"""What a person wants to know of a map: angles, stretch, starved parts, seam, texels."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import shapely
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.planar.crossing import crossing_vertices
from parapoint.planar.domains import frames, singular_values
from parapoint.surfaces.areas import LEAST_PART, STARVED
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import (
    BoolArray,
    FloatArray,
    IntArray,
    Mesh,
    flat_faces,
    turned_faces,
    twin_halfedges,
)
from parapoint.textures.texels import texels

DOUBLED = 1e-6
"""Share of a map's area that may be covered twice by rounding alone."""
FINE = 512
"""Texels along a side of the grid on which we count what a map fills whose faces overlap."""


@dataclass(frozen=True)
class Quality:
    """Numbers of one map in the unit square.

    Attributes:
        angle_mean: mean over the surface of the difference of a corner's angle in space and in the
            plane, in degrees.
        angle_worst: the largest, in degrees.
        stretch_mean: mean over the surface of the larger of s1 and 1 / s2, the singular values of
            a triangle's map at the mean scale; 1 where nothing is stretched or shrunk.
        stretch_worst: the largest.
        smallest_part: least mean area ratio (a part's share of the map over its share of the
            surface) of a connected starved part of at least 1 % of the surface; 1 for none.
        starved: share of the surface with an area ratio below STARVED.
        flipped: faces that are turned over.
        overlap: whether faces lie on others: "none", "some", or "unknown" where faces are turned
            over or an edge has more than two.
        charts: pieces of the map.
        seam: length of the cut over sqrt(area).
        filled: share of the unit square that the map fills; what lies twice counts once.
        texels_per_unit: of a texture, along a length of 1 of the mesh, at the mean scale.
    """

    angle_mean: float
    angle_worst: float
    stretch_mean: float
    stretch_worst: float
    smallest_part: float
    starved: float
    flipped: int
    overlap: str
    charts: int
    seam: float
    filled: float
    texels_per_unit: float

    def facts(self) -> dict[str, object]:
        """The numbers by name, four digits each."""
        return {
            name: float(f"{value:.4g}") if isinstance(value, float) else value
            for name, value in asdict(self).items()
        }


def quality(placed: Charted, texture: int) -> Quality:
    """The quality of a map in the unit square, with vertices at one place as one.

    Args:
        placed: the mesh and its map; faces without area take no part but in the charts.
        texture: texels along a side of the square.
    """
    placed = placed.welded()
    mesh, held = placed
    solid = ~flat_faces(mesh.vertices, mesh.faces)
    space = mesh.vertices[mesh.faces[solid]]
    corners = held.corners[solid]
    plane = np.pad(held.uv[corners], ((0, 0), (0, 0), (0, 1)))
    is_turned = _turned(corners)  # against its neighbours, in the mesh as in the map
    area, signed = _normals(space), _normals(plane)[:, 2] / 2 * np.where(is_turned, -1, 1)
    area = np.linalg.norm(area, axis=1) / 2
    ratio = (np.abs(signed) / np.abs(signed).sum()) / (area / area.sum())
    share = area / area.sum()
    angles = np.abs(_angles(plane) - _angles(space))
    scale = float(np.sqrt(area.sum() / np.abs(signed).sum()))
    frame = frames(mesh.vertices, mesh.faces[solid])
    s1, s2 = singular_values(frame, scale * held.uv, corners)
    stretch = np.maximum(s1, 1 / np.maximum(np.abs(s2), 1e-300))
    starved: BoolArray = np.zeros(len(mesh.faces), dtype=bool)
    starved[solid] = ratio < STARVED
    ends = mesh.vertices[held.seams(mesh)]
    cut = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum())
    whole = np.zeros((2, len(mesh.faces)))
    whole[:, solid] = share, ratio * share
    flipped = int((signed <= 0).sum())
    overlap = (
        "unknown"
        if flipped
        else _overlap(held.uv, np.where(is_turned[:, None], corners[:, ::-1], corners))
    )
    filled = float(np.abs(signed).sum())
    if overlap != "none":
        filled = texels(placed, FINE).inside.sum() / FINE**2
    return Quality(
        angle_mean=float(share @ angles.mean(axis=1)),
        angle_worst=float(angles.max()),
        stretch_mean=float(share @ stretch),
        stretch_worst=float(stretch.max()),
        smallest_part=_smallest_part(placed, starved, *whole),
        starved=float(share[ratio < STARVED].sum()),
        flipped=flipped,
        overlap=overlap,
        charts=int(held.charts().max()) + 1,
        seam=cut / float(np.sqrt(area.sum())),
        filled=filled,
        texels_per_unit=texture * float(np.sqrt(np.abs(signed).sum() / area.sum())),
    )


def _turned(corners: IntArray) -> BoolArray:
    """(F,) the faces that turn against their neighbours; a copy of a face is none of these."""
    least = (corners.argmin(axis=1)[:, None] + np.arange(3)) % 3
    alike = np.take_along_axis(corners, least, axis=1)
    _, first, number = np.unique(alike, axis=0, return_index=True, return_inverse=True)
    single = np.sort(first)
    turned = turned_faces(corners[single])
    return np.asarray(turned[np.searchsorted(single, first)][number.reshape(-1)])


def _overlap(uv: FloatArray, corners: IntArray) -> str:
    """Whether faces (F, 3) of a map (T, 2) without flips lie on others: "none", "some", "unknown".

    Where the boundaries of the charts cross or touch nothing, what they enclose by turns, inside
    and outside, is the area of all faces, unless a chart lies within another.
    """
    flat = Mesh(np.pad(uv, ((0, 0), (0, 1))), corners)
    if not (flat.is_manifold and flat.is_oriented):
        return "unknown"
    if len(crossing_vertices(flat, uv)):
        return "some"
    rings = [uv[np.append(loop, loop[0])] for loop in flat.boundary_loops]
    doubled = flat.face_areas.sum() - shapely.build_area(shapely.MultiLineString(rings)).area
    return "some" if doubled > DOUBLED * flat.face_areas.sum() else "none"


def _normals(triangles: FloatArray) -> FloatArray:
    """(F, 3) normals of triangles (F, 3, 3), as long as twice their area."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return np.asarray(np.cross(first, second))


def _angles(triangles: FloatArray) -> FloatArray:
    """(F, 3) angles at the corners of triangles (F, 3, 3), in degrees."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    back = np.roll(triangles, 1, axis=1) - triangles
    across = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.asarray(np.degrees(np.arctan2(across, (ahead * back).sum(axis=2))))


def _smallest_part(
    placed: Charted, starved: BoolArray, share: FloatArray, uv_share: FloatArray
) -> float:
    """Least mean area ratio of an edge-connected starved part of LEAST_PART; 1 for none."""
    one, other = (twins // 3 for twins in twin_halfedges(placed.mesh.edge_of_halfedge))
    near = starved[one] & starved[other]
    size = len(starved)
    graph = sparse.coo_matrix((np.ones(near.sum(), bool), (one[near], other[near])), (size, size))
    label = csgraph.connected_components(graph, directed=False)[1][starved]
    part = np.bincount(label, share[starved])
    uv_part = np.bincount(label, uv_share[starved])
    large = part >= LEAST_PART
    return float((uv_part[large] / part[large]).min(initial=1.0))
