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
FEW_CORNERS = 64
"""Corners up to which a polygon is cut in no time, whatever its shape."""
MOST_STEPS = 4e9
"""Steps, the cube of the corners each, that polygons may take which touch or cross themselves; the
bridge to a hole touches."""


def triangle_rows(vertices: FloatArray, sizes: IntArray, corners: IntArray) -> IntArray:
    """(F, 3) places in `corners` of the triangles of polygons, polygon by polygon.

    A polygon of n corners gives n - 2 triangles, a fan from its first corner. A quad that would
    fold along that diagonal (the two triangles face away from each other) is fanned from its
    second corner, which is right for every planar quad. A larger polygon whose fan would fold, or
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
        turn[quads] = (first * second).sum(axis=1) < 0
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
        for polygon, plane in zip(polygons[folded].tolist(), planes, strict=True):
            steps += _steps(plane)
            if n > MOST_CORNERS or steps > MOST_STEPS:
                raise InputError(
                    f"face {polygon} has {n} corners, too many to be cut into triangles here"
                    + ("" if n > MOST_CORNERS else ", since it touches or crosses itself")
                    + "; cut it before"
                )
            if (cut := ears(plane)) is not None:
                first = first_row[polygon]
                rows[first : first + n - 2] = starts[polygon] + cut
    return rows


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


def _steps(plane: FloatArray) -> float:
    """About how many steps it takes to cut a polygon (n, 2)."""
    count = len(plane)
    if count <= FEW_CORNERS or count > MOST_CORNERS:
        return float(count) ** 2
    if shapely.is_simple(shapely.linearrings(plane)):
        return float(count) ** 2
    return float(count) ** 3


def ears(plane: FloatArray) -> IntArray | None:
    """(n - 2, 3) rows of a polygon (n, 2) as triangles that turn as it does.

    None where no cut fills the polygon: it crosses itself.
    """
    found = mapbox_earcut.triangulate_float64(plane, np.array([len(plane)], dtype=np.uint32))
    triangles = _with_all_corners(np.asarray(found, dtype=np.int64).reshape(-1, 3), len(plane))
    if len(triangles) != len(plane) - 2:
        return None
    a, b, c = plane[triangles].transpose(1, 0, 2)
    turned = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0] < 0
    triangles[turned] = triangles[turned][:, ::-1]
    return triangles


def _with_all_corners(triangles: IntArray, count: int) -> IntArray:
    """The triangles (T, 3) of a ring, with the corners inside straight edges that earcut drops.

    A triangle at such an edge becomes a fan over the corners on it.
    """
    cut: list[tuple[int, int, int]] = []
    kept = np.unique(triangles)
    if len(kept) == count:
        return triangles[::-1]
    following = dict(zip(kept.tolist(), np.roll(kept, -1).tolist(), strict=True))
    waiting = [(int(a), int(b), int(c)) for a, b, c in triangles]
    while waiting:
        triangle = waiting.pop()
        for k in range(3):
            a, b, c = triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]
            p, q = (a, b) if following.get(a) == b else (b, a)
            if following.get(p) != q or (q - p) % count <= 1:
                continue
            steps = [(p + step) % count for step in range((q - p) % count + 1)]
            fan = list(pairwise(steps))
            del following[p]
            following |= dict(fan)
            waiting += [(i, j, c) for i, j in fan]
            break
        else:
            cut.append(triangle)
    return np.array(cut, dtype=np.int64).reshape(-1, 3)
