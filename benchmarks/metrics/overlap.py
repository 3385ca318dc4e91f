"""Exact overlap of triangles in the plane: which pairs overlap, and by how much area.

Candidates are pairs whose boxes overlap, found in a hierarchy of boxes; everything is done on whole
arrays of pairs, a bounded number at a time. Neighbours inside a
sound fan of triangles are dropped without any arithmetic on coordinates; the others pass a
separating-axis test, and what is left is clipped exactly. Triangles that only touch, at a vertex
or along an edge, do not overlap.

There may be as many candidates as pairs of faces: where faces lie on one another by the thousand.
Beyond `MOST_CANDIDATES` a sample of them stands for all (`crowds`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from benchmarks.metrics.boxes import Hierarchy
from benchmarks.metrics.crowds import Crowd
from parapoint.surfaces.areas import cross
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

MOST_CANDIDATES = 64
"""Candidates per face, on average, that are all looked at. Surfaces that are projected onto a
plane, and so lie on themselves throughout, have 5 to 32 ..."""
FEW_CANDIDATES = 1_000_000
"""... and so are this many in all, however few the faces."""
PAIRS_AT_ONCE = 1 << 13
"""Pairs of faces that are clipped at a time: their arrays stay in the processor's cache."""
ROUNDS = 8
"""How often a crowd is sampled for faces that no sample before has found to overlap."""
CROSSINGS = 1 << 22
"""Crossings of triangles and scanlines at most, which bounds the time of `covered_area` ..."""
CROSSINGS_AT_ONCE = 1 << 16
"""... and those that are looked at together, which bounds its memory."""
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
        sampled: whether there were too many candidates to look at each. Then areas and numbers are
            unbiased estimates from a sample, numbers mostly within 1 % and sums of areas within
            5 %; and a triangle of which `ROUNDS` samples could not tell whether it overlaps another
            counts as one that does.
    """

    area: FloatArray
    overlapped: BoolArray
    pair_count: int
    distant_pair_count: int
    sampled: bool = False


def overlaps(parameterization: Parameterization, sign: IntArray, angle: FloatArray) -> Overlaps:
    """The overlaps among the faces of a map that have a UV area.

    Args:
        parameterization: the map.
        sign: (F,) orientation of each image: 1, -1, or 0 for those without area, left out.
        angle: (F, 3) UV angle at each corner, radians.
    """
    faces = _Faces(parameterization, sign, angle)
    if len(faces.present) < 2:
        return _Sums(faces).overlaps(sampled=False)
    tree = Hierarchy(faces.images[faces.present])
    candidates: list[tuple[IntArray, IntArray]] = []
    left = max(FEW_CANDIDATES, MOST_CANDIDATES * len(faces.present))
    for i, j in tree.pairs():
        left -= len(i)
        if left < 0:
            return _sampled(faces, tree)
        candidates.append(faces.beyond_fans(i, j))
    found = _Sums(faces)
    for first, second in candidates:
        found.add(first, second)
    return found.overlaps(sampled=False)


def _sampled(faces: _Faces, tree: Hierarchy) -> Overlaps:
    """The overlaps of faces with too many candidates, by a sample of those."""
    crowd = Crowd(tree)
    found = _Sums(faces)
    first, second, weight, whole = crowd.sample()
    found.add(faces.present[first], faces.present[second], weight)
    sampled = not whole
    for _ in range(ROUNDS):
        open_ = ~found.overlapped[faces.present]
        if whole or not open_.any():
            break
        # Sums come from the one sample of all pairs; these tell only who overlaps.
        more = _Sums(faces)
        first, second, weight, whole = crowd.sample(open_)
        more.add(faces.present[first], faces.present[second], weight)
        found.overlapped |= more.overlapped
    if not whole:
        found.overlapped[faces.present] = True
    return found.overlaps(sampled=sampled)


class _Faces:
    """The images of a map's faces, and what the tests on pairs of them need.

    Attributes:
        images: (F, 3, 2) corners, counter-clockwise, so that inside is to the left of every side.
        present: (P,) the faces that have a UV area.
    """

    def __init__(
        self, parameterization: Parameterization, sign: IntArray, angle: FloatArray
    ) -> None:
        count = len(sign)
        self.corners = corners = parameterization.corners
        images = parameterization.uv[corners]
        self.images = images = np.where((sign < 0)[:, None, None], images[:, ::-1], images)
        self.present = np.flatnonzero(sign)
        self.extent = float(np.abs(images).max(initial=0.0))
        self.double_area = np.abs(cross(images[:, 1] - images[:, 0], images[:, 2] - images[:, 0]))
        self.longest = np.maximum.reduce(
            [np.hypot(*(images[:, k] - images[:, (k + 1) % 3]).T) for k in range(3)]
        )
        # A shared row of a sound fan proves that two faces do not overlap; others get distinct
        # marks.
        sound = sound_fans(parameterization, sign, angle)
        self.fans = np.where(sound[corners], corners, -1 - np.arange(3 * count).reshape(count, 3))

    def beyond_fans(self, i: IntArray, j: IntArray) -> tuple[IntArray, IntArray]:
        """Those faces among the present ones `i` and `j`, pair by pair, that share no sound fan."""
        first, second = self.present[i], self.present[j]
        kept = ~_share_an_entry(self.fans, first, second)
        return first[kept], second[kept]

    def common(self, first: IntArray, second: IntArray) -> tuple[BoolArray, FloatArray]:
        """Which pairs overlap: (N,); and the common areas of those."""
        # The smaller triangle comes first: it is the one to be clipped.
        larger_first = self.double_area[first] > self.double_area[second]
        first, second = np.where(larger_first, (second, first), (first, second))
        a, b = _across(self.images, first), _across(self.images, second)
        tolerance = ROUNDING * self.extent * np.minimum(self.longest[first], self.longest[second])
        overlap = ~separated(a, b, tolerance)
        common = common_area(a[:, :, overlap], b[:, :, overlap])
        least = np.maximum(SMALLEST_SHARE * self.double_area[first] / 2, tolerance)[overlap]
        overlap[overlap] = common > least
        return overlap, common[common > least]


class _Sums:
    """Sums over overlapping pairs, as they are found."""

    def __init__(self, faces: _Faces) -> None:
        self.faces = faces
        self.area = np.zeros(len(faces.corners))
        self.overlapped = np.zeros(len(faces.corners), dtype=bool)
        self.pair_count = self.distant_pair_count = 0.0

    def add(self, first: IntArray, second: IntArray, weight: FloatArray | None = None) -> None:
        """Add pairs of faces, each of which stands for `weight` pairs."""
        for start in range(0, len(first), PAIRS_AT_ONCE):
            piece = slice(start, start + PAIRS_AT_ONCE)
            kept, common = self.faces.common(first[piece], second[piece])
            i, j = first[piece][kept], second[piece][kept]
            times = np.ones(len(i)) if weight is None else weight[piece][kept]
            np.add.at(self.area, i, times * common)
            np.add.at(self.area, j, times * common)
            self.overlapped[i] = self.overlapped[j] = True
            self.pair_count += times.sum()
            self.distant_pair_count += times[~_share_an_entry(self.faces.corners, i, j)].sum()

    def overlaps(self, *, sampled: bool) -> Overlaps:
        """What has been found."""
        count, distant = round(self.pair_count), round(self.distant_pair_count)
        return Overlaps(self.area, self.overlapped, count, distant, sampled)


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
    # Lines are taken some at a time, about as many as have `CROSSINGS_AT_ONCE`.
    crossings = np.cumsum(np.bincount(first, minlength=lines + 1))
    crossings -= np.cumsum(np.bincount(beyond, minlength=lines + 1))
    piece = np.cumsum(crossings) // CROSSINGS_AT_ONCE
    bounds = [0, *(np.flatnonzero(np.diff(piece)) + 1).tolist(), lines]
    covered = 0.0
    for start, end in itertools.pairwise(bounds):
        here = np.flatnonzero((first < end) & (beyond > start))
        from_, to = np.maximum(first[here], start), np.minimum(beyond[here], end)
        line = np.repeat(from_ - np.cumsum(to - from_) + (to - from_), to - from_)
        line += np.arange(len(line))
        of = np.repeat(here, to - from_)
        covered += _covered(x[of], y[of], line - start, low + (line + 0.5) * step)
    return covered * step


def _covered(x: FloatArray, y: FloatArray, line: IntArray, height: FloatArray) -> float:
    """The length of lines within triangles (N, 3), sorted by y, each crossed by one at a height."""
    (x0, x1, x2), (y0, y1, y2) = x.T, y.T
    on_long = x0 + (x2 - x0) * ((height - y0) / (y2 - y0))
    upper = height > y1
    foot_x, foot_y = np.where(upper, x1, x0), np.where(upper, y1, y0)
    head_x, head_y = np.where(upper, x2, x1), np.where(upper, y2, y1)
    rise = np.where(head_y > foot_y, head_y - foot_y, 1.0)
    on_short = foot_x + (head_x - foot_x) * ((height - foot_y) / rise)
    # Each line gets its own stretch of the axis, so that one running maximum serves them all.
    shift = line * (2 * float(np.ptp(x))) - float(x.min()) if len(x) else 0.0
    left, right = np.minimum(on_long, on_short) + shift, np.maximum(on_long, on_short) + shift
    order = np.argsort(left)
    left, right = left[order], right[order]
    reached = np.maximum.accumulate(right)
    fresh = right - np.maximum(left, np.concatenate([[-np.inf], reached[:-1]]))
    return float(np.maximum(fresh, 0.0).sum())
