"""Polygons of a file, cut into triangles."""

from __future__ import annotations

from itertools import pairwise

import mapbox_earcut
import numpy as np
import shapely

from parapoint.errors import InputError
from parapoint.files.content import ranges
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

THIN = 1e-9
"""Share of a polygon's area below which a triangle of its fan counts as folded or flat."""
MOST_CORNERS = 20_000
"""Corners that a polygon may have where no fan fills it: cutting it takes time by their square."""
FEW_CORNERS = 16
"""Corners up to which a polygon is cut in no time, whatever its shape."""
MOST_STEPS = 3_000_000_000
"""Steps, the cube of the corners each, that polygons may take which touch or cross themselves; the
bridge to a hole touches."""
LEAST_PASSES = 160
"""A small polygon takes as many steps for the square of its corners as one of so many corners."""


def triangle_rows(vertices: FloatArray, sizes: IntArray, corners: IntArray) -> IntArray:
    """(F, 3) places in `corners` of the triangles of polygons, polygon by polygon.

    A polygon of n corners gives n - 2 triangles, a fan from its first corner. A quad that would
    fold along that diagonal (the two triangles face away from each other) is fanned from its
    second corner, which is right for every planar quad; quads of the same corners, as the two sides
    of a sheet are, get the same diagonal. A larger polygon whose fan would fold, or
    have a triangle without area, is cut by ears in its mean plane (mapbox/earcut), which is right
    for every planar polygon, with a bridge to a hole as well.

    Args:
        vertices: (V, 3) positions, finite.
        sizes: (N,) corners of each polygon, at least 3.
        corners: (sum of sizes,) rows of `vertices`.

    Raises:
        InputError: polygons are too large to be cut, or too large and cross themselves.
    """
    starts = np.cumsum(sizes) - sizes
    scale = float(np.abs(vertices).max(initial=0)) or 1.0  # products of huge coordinates overflow
    turn = np.zeros(len(sizes), dtype=np.int64)
    quads = np.flatnonzero(sizes == 4)
    if len(quads):
        a, b, c, d = (vertices[corners[starts[quads] + k]] / scale for k in range(4))
        first, second = np.cross(b - a, c - a), np.cross(c - a, d - a)
        folds = (first * second).sum(axis=1) < 0
        turn[quads] = _cut_alike(corners[starts[quads, None] + np.arange(4)], folds)
    count = sizes - 2
    step = ranges(np.ones_like(count), count)
    place = np.stack([np.zeros_like(step), step, step + 1], axis=1)
    start, shift, size = (np.repeat(values, count)[:, None] for values in (starts, turn, sizes))
    rows = np.asarray(start + (place + shift) % size)
    first_row = np.cumsum(count) - count
    steps = 0.0
    for n in np.unique(sizes[sizes > 4]).tolist():
        polygons = np.flatnonzero(sizes == n)
        rings = vertices[corners[starts[polygons, None] + np.arange(n)]] / scale
        folded, planes = _folded(rings)
        polygons = polygons[folded]
        steps += _refuse_large(polygons, planes, steps)
        cut, triangles = ears(planes)
        places = first_row[polygons[cut], None] + np.arange(n - 2)
        rows[places] = starts[polygons[cut], None, None] + triangles
    return rows


def _cut_alike(quads: IntArray, folds: BoolArray) -> IntArray:
    """(N,) the corner, 0 or 1, at which the diagonal of each quad (N, 4) begins.

    It is 1 where the quad `folds` (N,) along the other one. Of quads with the same corners the
    first decides.
    """
    _, first, number = np.unique(
        np.sort(quads, axis=1), axis=0, return_index=True, return_inverse=True
    )
    leader, turn = first[number.reshape(-1)], folds.astype(np.int64)
    apex = quads[leader, turn[leader]]
    alike = (quads[:, 1] == apex) | (quads[:, 3] == apex)
    return np.where(leader == np.arange(len(quads)), turn, alike)


def corner_rows(places: IntArray, rows: IntArray) -> tuple[IntArray, BoolArray]:
    """(C,) the uv row at each corner of polygons, and (F,) the triangles that need others.

    Where the seam runs through a polygon, some corners of its triangles have another row.

    Args:
        places: (F, 3) for each corner of the triangles, its place among the polygons' corners.
        rows: (F, 3) its uv row.
    """
    row = np.full(int(places.max()) + 1, -1, dtype=np.int64)
    row[places] = rows
    return row, (row[places] != rows).any(axis=1)


def _folded(rings: FloatArray) -> tuple[BoolArray, FloatArray]:
    """(N,) the polygons (N, n, 3) whose fan from the first corner is wrong, and these in the plane.

    The second are (M, n, 2), each in its mean plane and counter-clockwise. A polygon without area
    has no plane; its fan is as good as any.
    """
    edges = rings[:, 1:] - rings[:, :1]
    fan = np.cross(edges[:, :-1], edges[:, 1:])
    normal = fan.sum(axis=1)
    squared = (normal**2).sum(axis=1)
    is_right = ((fan * normal[:, None]).sum(axis=2) > THIN * squared[:, None]).all(axis=1)
    folded = ~is_right & (squared > 0)
    rings, normal = rings[folded], normal[folded]
    drop = np.abs(normal).argmax(axis=1)
    kept = np.array([(1, 2), (2, 0), (0, 1)])[drop]
    planes = np.take_along_axis(rings - rings[:, :1], kept[:, None], axis=2)
    planes[..., 1] *= np.sign(np.take_along_axis(normal, drop[:, None], axis=1))
    return folded, planes


def _refuse_large(polygons: IntArray, planes: FloatArray, steps: float) -> float:
    """About how many steps it takes to cut these polygons (N, n, 2), after `steps` for others."""
    count = planes.shape[1]
    taken = np.full(len(planes), float(count) ** 2)
    if FEW_CORNERS < count <= MOST_CORNERS:
        crossing = ~shapely.is_simple(shapely.linearrings(planes))
        taken[crossing] *= max(count, LEAST_PASSES)
    too_many = (steps + np.cumsum(taken) > MOST_STEPS) | (count > MOST_CORNERS)
    if too_many.any():
        raise InputError(
            f"face {polygons[too_many][0]} has {count} corners, too many to be cut into triangles "
            "here"
            + ("" if count > MOST_CORNERS else ", since it touches or crosses itself")
            + "; cut it before"
        )
    return float(taken.sum())


def ears(planes: FloatArray) -> tuple[BoolArray, IntArray]:
    """(N,) the polygons (N, n, 2) that a cut fills, and these as (M, n - 2, 3) rows of triangles.

    The triangles turn as their polygon does. One that crosses itself may not be filled.
    """
    number, count = planes.shape[:2]
    hole = np.array([count], dtype=np.uint32)
    found = [mapbox_earcut.triangulate_float64(plane, hole) for plane in planes]
    lengths = np.array([len(triangles) // 3 for triangles in found], dtype=np.int64)
    used = np.zeros((number, count), dtype=bool)
    if number:
        used[np.repeat(np.arange(number), 3 * lengths), np.concatenate(found)] = True
    left_out = count - used.sum(axis=1)
    triangles = np.zeros((number, count - 2, 3), dtype=np.int64)
    cut = (lengths == count - 2) & (left_out == 0)
    if cut.any():
        chosen = [found[polygon] for polygon in np.flatnonzero(cut).tolist()]
        triangles[cut] = np.concatenate(chosen).reshape(-1, count - 2, 3)[:, ::-1]
    fillable = (left_out > 0) & (lengths + left_out >= count - 2)
    for polygon in np.flatnonzero(fillable).tolist():
        filled = _with_all_corners(found[polygon].reshape(-1, 3).tolist(), count)
        cut[polygon] = len(filled) == count - 2
        if cut[polygon]:
            triangles[polygon] = filled
    triangles = triangles[cut]
    a, b, c = np.moveaxis(planes[np.flatnonzero(cut)[:, None, None], triangles], 2, 0)
    turned = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return cut, triangles


def _with_all_corners(triangles: list[list[int]], count: int) -> list[list[int]]:
    """The triangles of a ring, with the corners inside straight edges that earcut drops.

    A triangle at such an edge becomes a fan over the corners on it.
    """
    kept = sorted({corner for triangle in triangles for corner in triangle})
    following = zip(kept, [*kept[1:], *kept[:1]], strict=True)
    gaps = {p: q for p, q in following if (q - p) % count > 1}
    cut: list[list[int]] = []
    waiting = triangles
    while waiting and gaps:
        a, b, c = waiting.pop()
        for p, q, opposite in (a, b, c), (b, a, c), (b, c, a), (c, b, a), (c, a, b), (a, c, b):
            if gaps.get(p) == q:
                del gaps[p]
                steps = [(p + step) % count for step in range((q - p) % count + 1)]
                waiting += [[i, j, opposite] for i, j in pairwise(steps)]
                break
        else:
            cut.append([a, b, c])
    return cut + waiting[::-1]
