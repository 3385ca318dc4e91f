"""A cloud thinned while it is read: no denser than a texture can show, however many points come."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from parapoint.errors import InputError
from parapoint.files.attributes import colours_of
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import FloatArray, IntArray, PointCloud
from parapoint.textures.baking import SHOWN, check_bakeable

CUBES_OF_A_TEXEL = 2
"""Cubes along a texel's side. Of the points in a cube the first one stays, so that a texel keeps
four to eight."""
MOST_CUBES = 2**20
"""Cubes along a side of the model's box at most: three such numbers fit into 63 bits."""


def thinned(
    pieces: Iterable[PointCloud], kind: str, charted: Charted, size: int
) -> tuple[PointCloud, int]:
    """The points that a texture can show, with what it shows of them, and how many there were.

    The result is the same however the cloud is divided into pieces.

    Args:
        pieces: parts of a cloud, in order.
        kind: what is baked, one of MAPS.
        charted: the mesh that the texture is for, and its map in the unit square.
        size: texels along a side of the texture.

    Raises:
        InputError: there are no points, or they have not what the map shows.
    """
    used = charted.mesh.vertices[charted.mesh.referenced]
    low, extent = used.min(axis=0), float(np.ptp(used, axis=0).max())
    side = max(_texel(charted, size) / CUBES_OF_A_TEXEL, extent / MOST_CUBES, 1e-300)
    kept: list[PointCloud] = []
    taken: IntArray = np.zeros(0, dtype=np.int64)
    count = 0
    for piece in pieces:
        cubes, first = np.unique(_cubes(piece.points, low, side), return_index=True)
        fresh = np.append(taken, -1)[np.searchsorted(taken, cubes)] != cubes
        count += len(piece.points)
        if fresh.any():
            taken = np.sort(np.concatenate([taken, cubes[fresh]]), kind="stable")  # merges two
            kept.append(_rows(piece, np.sort(first[fresh]), kind))
    if not kept:
        raise InputError("has no point with finite coordinates")
    cloud = _joined(kept, kind)
    if not cloud.attributes:
        check_bakeable(piece, kind)
    check_bakeable(cloud, kind)
    return cloud, count


def _texel(charted: Charted, size: int) -> float:
    """The side of a texel on the surface, at the mean scale; 0 for a mesh or map without area."""
    image = float(np.abs(signed_areas(charted.map.uv, charted.map.corners)).sum())
    return float(np.sqrt(charted.mesh.face_areas.sum() / max(image, 1e-300))) / size


def _cubes(points: FloatArray, low: FloatArray, side: float) -> IntArray:
    """(N,) a number for the cube of each point; those far from the model share the outermost."""
    place = np.clip(np.floor((points - low) / side), -1, MOST_CUBES).astype(np.int64) + 1
    return np.asarray(place @ np.array([1, 2 * MOST_CUBES, 4 * MOST_CUBES**2]))


def _rows(cloud: PointCloud, rows: IntArray, kind: str) -> PointCloud:
    """Some points of a cloud, with what a map shows of them."""
    normals = cloud.normals[rows] if kind == "normal" and cloud.normals is not None else None
    shown = {name: of[rows] for name, of in cloud.attributes.items() if name == SHOWN.get(kind)}
    return PointCloud(cloud.points[rows], normals, attributes=shown)


def _joined(parts: list[PointCloud], kind: str) -> PointCloud:
    """One cloud of all parts.

    Those without colours among others that have them are black: so LAS writes black, and a file
    that has no colours.
    """
    points = np.concatenate([part.points for part in parts])
    normals = [part.normals for part in parts if part.normals is not None]
    name = SHOWN.get(kind, "")
    like = next((part.attributes[name] for part in parts if name in part.attributes), None)
    shown = {}
    if like is not None:
        values = [
            part.attributes.get(name, np.zeros((len(part.points), *like.shape[1:]), np.uint8))
            for part in parts
        ]
        joined = np.concatenate(values)
        colours = colours_of(joined) if kind == "colour" else joined
        shown = {} if colours is None else {name: colours}
    whole = len(normals) == len(parts)
    return PointCloud(points, np.concatenate(normals) if whole else None, attributes=shown)
