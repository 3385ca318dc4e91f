"""Exact overlap of triangles in the plane: which pairs overlap, and by how much area.

Candidates are pairs whose boxes overlap, found in a hierarchy of boxes; everything is done on whole
arrays of pairs, a bounded number at a time. Neighbours inside a
sound fan of triangles are dropped without any arithmetic on coordinates; the others pass a
separating-axis test, and what is left is clipped exactly. Triangles that only touch, at a vertex
or along an edge, do not overlap.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

NODES_AT_ONCE = 1 << 13
"""Pairs of boxes opened at a time: their arrays stay in the processor's cache."""
ALL_FOUR = np.uint32(0x01010101)
CROSSINGS = 1 << 22
"""Crossings of triangles and scanlines at most, which bounds the memory of `covered_area`."""
SMALLEST_SHARE = 1e-10
"""Two triangles overlap if the common area exceeds this times the smaller triangle ..."""
ROUNDING = 8 * np.finfo(np.float64).eps
"""... and this times (largest coordinate x longest side of the smaller): rounding of positions."""


@dataclass(frozen=True, eq=False)
class Overlaps:
    """How the triangles of a map overlap.

    Attributes:
        area: (F,) sum over all other triangles of the common area, in units of UV area.
        overlapped: (F,) whether the triangle overlaps any other.
        pair_count: number of overlapping pairs.
        distant_pair_count: number of those that share no row of uv.
    """

    area: FloatArray
    overlapped: BoolArray
    pair_count: int
    distant_pair_count: int


def overlaps(parameterization: Parameterization, sign: IntArray, angle: FloatArray) -> Overlaps:
    """The overlaps among the faces of a map that have a UV area.

    Args:
        parameterization: the map.
        sign: (F,) orientation of each image: 1, -1, or 0 for those without area, left out.
        angle: (F, 3) UV angle at each corner, radians.
    """
    count = len(sign)
    corners = parameterization.corners
    images = parameterization.uv[corners]
    # Counter-clockwise, so that inside is to the left of every side.
    images = np.where((sign < 0)[:, None, None], images[:, ::-1], images)
    extent = float(np.abs(images).max(initial=0.0))
    double_area = np.abs(_cross(images[:, 1] - images[:, 0], images[:, 2] - images[:, 0]))
    longest = np.maximum.reduce(
        [np.hypot(*(images[:, k] - images[:, (k + 1) % 3]).T) for k in range(3)]
    )
    # A shared row of a sound fan proves that two faces do not overlap; others get distinct marks.
    sound = sound_fans(parameterization, sign, angle)
    fans = np.where(sound[corners], corners, -1 - np.arange(3 * count).reshape(count, 3))

    area = np.zeros(count)
    overlapped = np.zeros(count, dtype=bool)
    pair_count = distant_pair_count = 0
    present = np.flatnonzero(sign)
    lower = np.minimum.reduce([images[present, k] for k in range(3)])
    upper = np.maximum.reduce([images[present, k] for k in range(3)])
    for i, j in box_pairs(lower, upper):
        first, second = present[i], present[j]
        kept = ~_share_an_entry(fans, first, second)
        first, second = first[kept], second[kept]
        # The smaller triangle comes first: it is the one to be clipped.
        larger_first = double_area[first] > double_area[second]
        first, second = np.where(larger_first, (second, first), (first, second))
        a, b = _across(images, first), _across(images, second)
        tolerance = ROUNDING * extent * np.minimum(longest[first], longest[second])
        kept = ~separated(a, b, tolerance)
        first, second, tolerance = first[kept], second[kept], tolerance[kept]
        common = common_area(a[:, :, kept], b[:, :, kept])
        kept = common > np.maximum(SMALLEST_SHARE * double_area[first] / 2, tolerance)
        first, second, common = first[kept], second[kept], common[kept]
        np.add.at(area, first, common)
        np.add.at(area, second, common)
        overlapped[first] = overlapped[second] = True
        pair_count += len(first)
        distant_pair_count += int((~_share_an_entry(corners, first, second)).sum())
    return Overlaps(area, overlapped, pair_count, distant_pair_count)


def sound_fans(parameterization: Parameterization, sign: IntArray, angle: FloatArray) -> BoolArray:
    """(T,) whether the triangles at each row of uv lie around it side by side.

    So they do if they turn the same way, hang together by edges as one fan, and their angles sum
    to no more than a full turn. Such triangles cannot overlap one another: each stays within its
    own sector. A row that fails may still be without overlap.
    """
    size = len(parameterization.uv)
    corners, edges = parameterization.corners, parameterization.edges
    row, present = corners.reshape(-1), np.repeat(sign != 0, 3)
    faces_at = np.bincount(row[present], minlength=size)
    positive_at = np.bincount(row[np.repeat(sign > 0, 3)], minlength=size)
    turn = np.bincount(row[present], angle.reshape(-1)[present], minlength=size)
    # Inside edges have two faces with area, which run along it in opposite directions.
    forward = row < np.roll(corners, -1, axis=1).reshape(-1)
    edge = parameterization.edge_of_halfedge[present]
    faces_along = np.bincount(edge, minlength=len(edges))
    forward_along = np.bincount(edge, forward[present], minlength=len(edges))
    inside = (faces_along == 2) & (forward_along == 1)
    broken = (faces_along > 2) | ((faces_along == 2) & (forward_along != 1))
    inside_at = np.bincount(edges[inside].reshape(-1), minlength=size)
    sound = (positive_at == 0) | (positive_at == faces_at)
    sound &= faces_at - inside_at <= 1
    sound &= turn <= 2 * np.pi + 1e-9
    sound[edges[broken].reshape(-1)] = False
    return np.asarray(sound)


def box_pairs(lower: FloatArray, upper: FloatArray) -> Iterator[tuple[IntArray, IntArray]]:
    """All pairs i != j of boxes with common area, each pair once, in pieces of bounded size.

    A binary hierarchy of boxes over a space-filling order, descended for all pairs of a piece at
    once. At 100k triangles it takes half the time of a tree of shapes.

    Args:
        lower: (N, 2) smallest coordinates of each box.
        upper: (N, 2) largest coordinates.
    """
    if len(lower) < 2:
        return
    order = _morton_order((lower + upper) / 2)
    # A box is a row (lower, -upper): the box around two is their minimum, and infinity is no box.
    levels = [np.concatenate([lower, -upper], axis=1)[order]]
    while len(levels[-1]) > 1:
        boxes = levels[-1]
        if len(boxes) % 2:
            boxes = levels[-1] = np.concatenate([boxes, np.full((1, 4), np.inf)])
        levels.append(np.minimum(boxes[0::2], boxes[1::2]))
    # Boxes a, b overlap if lower_a < upper_b and -upper_a < -lower_b: a row of opposites of b.
    opposites = [np.ascontiguousarray(-boxes[:, [2, 3, 0, 1]]) for boxes in levels]
    root = np.zeros(1, dtype=np.int64)
    stack = [(len(levels) - 1, root, root)]
    while stack:
        level, i, j = stack.pop()
        if level == 0:
            yield order[i], order[j]
            continue
        if len(i) > NODES_AT_ONCE:
            half = len(i) // 2
            stack += [(level, i[half:], j[half:]), (level, i[:half], j[:half])]
            continue
        left, right, two = 2 * i, 2 * j, np.flatnonzero(i != j)
        # Children of one node with itself: three pairs; of two nodes: four.
        i = np.concatenate([left, left, left + 1, left.take(two) + 1])
        j = np.concatenate([right, right + 1, right + 1, right.take(two)])
        level -= 1
        if level == 0:
            two = np.flatnonzero(i != j)
            i, j = i.take(two), j.take(two)
        overlap = levels[level].take(i, axis=0) < opposites[level].take(j, axis=0)
        # Four truths side by side are one integer, which compares much faster than `all`.
        kept = np.flatnonzero(overlap.view(np.uint32)[:, 0] == ALL_FOUR)
        stack.append((level, i.take(kept), j.take(kept)))


def _morton_order(points: FloatArray) -> IntArray:
    """(N,) the points along a Z-curve, so that neighbours in the order are near in the plane."""
    low, side = points.min(axis=0), float(np.ptp(points, axis=0).max())
    cells = ((points - low) * ((2**16 - 1) / side if side > 0 else 0.0)).astype(np.uint32)
    for shift, mask in ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555)):
        cells = (cells | (cells << np.uint32(shift))) & np.uint32(mask)
    order = np.argsort(cells[:, 0] | (cells[:, 1] << np.uint32(1)), kind="stable")
    return np.asarray(order, dtype=np.int64)


def _across(images: FloatArray, chosen: IntArray) -> FloatArray:
    """(3, 2, N) the chosen triangles, each coordinate of all of them in one piece of memory."""
    return np.ascontiguousarray(images.take(chosen, axis=0).transpose(1, 2, 0))


def _share_an_entry(rows: IntArray, i: IntArray, j: IntArray) -> BoolArray:
    """(N,) whether rows i and j of an (F, 3) array have an entry in common."""
    a, b = rows.take(i, axis=0), rows.take(j, axis=0)
    shared = np.zeros(len(i), dtype=bool)
    for k in range(3):
        for l in range(3):
            shared |= a[:, k] == b[:, l]
    return shared


def separated(a: FloatArray, b: FloatArray, tolerance: FloatArray) -> BoolArray:
    """(N,) whether a side of one of two counter-clockwise triangles has the other outside.

    Args:
        a: (3, 2, N) triangles, so that each operation runs along all pairs.
        b: (3, 2, N) triangles.
        tolerance: (N,) a point no further inside than this over the side's length is outside.
    """
    apart = np.zeros(a.shape[2], dtype=bool)
    for one, other in ((a, b), (b, a)):
        for k in range(3):
            inside = _inside(other[:, 0], other[:, 1], one[k], one[(k + 1) % 3])
            apart |= np.maximum(np.maximum(inside[0], inside[1]), inside[2]) <= tolerance
    return apart


def common_area(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N,) area that two counter-clockwise triangles have in common.

    `a`, best the smaller one, is clipped by each side of `b` in turn. What lies beyond a side is
    moved onto its line, where it encloses no area, so that all polygons keep one length.

    Args:
        a: (3, 2, N) triangles.
        b: (3, 2, N) triangles.
    """
    origin = a[0]
    x, y = (a - origin)[:, 0], (a - origin)[:, 1]
    clip = b - origin
    for k in range(3):
        x, y = _clipped(x, y, clip[k], clip[(k + 1) % 3])
    doubled = (x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0)).sum(axis=0)
    return np.asarray(np.maximum(doubled / 2, 0.0))


def _inside(x: FloatArray, y: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """(k, N) distance of points to the left of start -> end (2, N), times the length of that."""
    side = end - start
    return np.asarray(side[0] * (y - start[1]) - side[1] * (x - start[0]))


def _clipped(
    x: FloatArray, y: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Polygons of 2k corners: those of k corners (k, N) to the left of start -> end (2, N).

    Each corner hands on itself, or its foot on the line, and then the crossing of the side that
    follows, or itself once more.
    """
    inside = _inside(x, y, start, end)
    following = np.roll(inside, -1, axis=0)
    crosses = (inside < 0) != (following < 0)
    fraction = np.zeros_like(inside)
    np.divide(inside, inside - following, out=fraction, where=crosses)
    side = end - start
    foot = np.minimum(inside, 0.0) / (side[0] ** 2 + side[1] ** 2)
    clipped = []
    for values, normal in ((x, side[1]), (y, -side[0])):
        corners = np.empty((2 * len(values), values.shape[1]))
        corners[0::2] = values + foot * normal
        crossing = values + fraction * (np.roll(values, -1, axis=0) - values)
        corners[1::2] = np.where(crosses, crossing, corners[0::2])
        clipped.append(corners)
    return clipped[0], clipped[1]


def covered_area(images: FloatArray) -> float:
    """The area of the union of (N, 3, 2) triangles, by exact interval lengths along scanlines.

    The midpoint rule over 4096 lines, fewer where there would be more than `CROSSINGS`: off by
    some 1e-5 of the area for triangles of many lines' height.
    """
    if len(images) == 0:
        return 0.0
    images = np.take_along_axis(images, np.argsort(images[:, :, 1], axis=1)[:, :, None], axis=1)
    x, y = images[:, :, 0], images[:, :, 1]
    low, high = float(y[:, 0].min()), float(y[:, 2].max())
    heights = float((y[:, 2] - y[:, 0]).sum())
    if heights == 0:
        return 0.0
    lines = int(min(4096, np.ceil(CROSSINGS * (high - low) / heights)))
    step = (high - low) / lines
    # Line l at (l + 1/2) step: those that each triangle crosses run from `first` to `beyond`.
    first = np.ceil((y[:, 0] - low) / step - 0.5).astype(np.int64)
    beyond = np.ceil((y[:, 2] - low) / step - 0.5).astype(np.int64)
    count = beyond - first
    triangle = np.repeat(np.arange(len(images)), count)
    line = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count - first, count)
    height = low + (line + 0.5) * step
    (x0, x1, x2), (y0, y1, y2) = x[triangle].T, y[triangle].T
    on_long = x0 + (x2 - x0) * ((height - y0) / (y2 - y0))
    upper = height > y1
    foot_x, foot_y = np.where(upper, x1, x0), np.where(upper, y1, y0)
    head_x, head_y = np.where(upper, x2, x1), np.where(upper, y2, y1)
    rise = np.where(head_y > foot_y, head_y - foot_y, 1.0)
    on_short = foot_x + (head_x - foot_x) * ((height - foot_y) / rise)
    # Each line gets its own stretch of the axis, so that one running maximum serves them all.
    shift = line * (2 * float(np.ptp(x))) - float(x.min())
    left, right = np.minimum(on_long, on_short) + shift, np.maximum(on_long, on_short) + shift
    order = np.argsort(left)
    left, right = left[order], right[order]
    reached = np.maximum.accumulate(right)
    fresh = right - np.maximum(left, np.concatenate([[-np.inf], reached[:-1]]))
    return float(np.maximum(fresh, 0.0).sum() * step)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], dtype=np.float64)
