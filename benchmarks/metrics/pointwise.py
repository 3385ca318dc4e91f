"""Metrics of a map of a point cloud. They need no mesh, so that a raw scan can be scored.

Neighbours are the k = 8 nearest other points. Without faces there are no areas to weigh by: every
mean is over the points, and each point counts the same.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from benchmarks.metrics.distortion import mean, power_above
from benchmarks.metrics.seams import QUARTILE, SPANNING_LENGTH, SPANNING_STRETCH, square_side
from parapoint.errors import InputError
from parapoint.surfaces.areas import LEAST_PART, STARVED
from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.places import places
from parapoint.surfaces.scan_lines import breadth
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, PointCloud

NEIGHBOURS = 8
"""Nearest other points that count as the neighbours of a point: k."""
WIDER = 1.5
"""On scan lines neighbours are chosen from this many times as many nearest points as just reach the
next line."""
SEAM_NEIGHBOURS = 3
"""Nearest other points across which a seam is looked for: K_cut of ParaPoint. Its T_cut is
`SPANNING_LENGTH`."""
RANKED_POINTS = 20_000
"""Ranks are taken at no more points than this, evenly spread over the order of the cloud."""
COUNTED = 200_000_000
"""Points that all ranks together count, at most; beyond, evenly spread ranks stand for all."""
PROBES = 256
"""Ranks that tell how many points all of them will count."""


@dataclass(frozen=True, eq=False)
class PointMap:
    """A mapped point cloud, with what several metrics share; scaled by powers of two.

    Attributes:
        points: (P, 3) the points that have a uv.
        uv: (P, 2) their images.
        coverage: the share of all points, from 0 to 1, that have a uv.
    """

    points: FloatArray
    uv: FloatArray
    coverage: float = 1.0

    @cached_property
    def tree(self) -> cKDTree:
        """Search tree of the points."""
        return cKDTree(self.points)

    @cached_property
    def uv_tree(self) -> cKDTree:
        """Search tree of the images."""
        return cKDTree(self.uv)

    @property
    def k(self) -> int:
        """Number of neighbours: NEIGHBOURS, or all other points of a smaller cloud."""
        return min(NEIGHBOURS, len(self.points) - 1)

    @cached_property
    def neighbours(self) -> IntArray:
        """(P, k) nearest other points, nearest first."""
        return nearest_others(self.tree, self.k)

    @cached_property
    def uv_neighbours(self) -> IntArray:
        """(P, k) other points with the nearest images, nearest first."""
        return nearest_others(self.uv_tree, self.k)

    @cached_property
    def around(self) -> IntArray:
        """(P, k) other points that lie to all sides of each point.

        These are its neighbours, unless all of them lie on its own scan line. Then they are chosen
        evenly by rank among as many nearest points as spread over the surface
        (`parapoint.surfaces.scan_lines`).
        """
        if (count := breadth(self.points)) is None:
            return self.neighbours
        around = self.neighbours.copy()
        for most in np.unique(count[count > self.k]):
            rows = np.flatnonzero(count == most)
            rank = np.round(np.linspace(most / self.k, WIDER * most, self.k)).astype(np.int64)
            around[rows] = self.tree.query(self.points[rows], rank + 1)[1]
        return around

    @cached_property
    def singular_values(self) -> FloatArray:
        """(P, 2) singular values, larger first, of the least-squares J at each point.

        J maps offsets in the tangent plane to offsets in UV; the two main directions of the points
        around give the plane. (0, 0) where these points span no plane.
        """
        around = self.around
        offsets = self.points[around] - self.points[:, None]
        images = self.uv[around] - self.uv[:, None]
        _, spread, axes = np.linalg.svd(offsets, full_matrices=False)
        planar = spread[:, 1] > 1e-9 * np.maximum(spread[:, 0], np.finfo(np.float64).tiny)
        local = offsets[planar] @ axes[planar, :2].transpose(0, 2, 1)
        jacobian = np.linalg.pinv(local) @ images[planar]
        values = np.zeros((len(self.points), 2))
        values[planar] = np.linalg.svd(jacobian, compute_uv=False)
        return values

    @cached_property
    def spanning(self) -> BoolArray:
        """(P,) whether the map tears between a point and one of its neighbours.

        Conditions 1 and 2 of `benchmarks.metrics.seams`, for pairs of neighbours in place of edges.
        """
        start = np.repeat(np.arange(len(self.points)), self.k)
        end = self.neighbours.reshape(-1)
        length = np.linalg.norm(self.points[end] - self.points[start], axis=1)
        uv_length = np.linalg.norm(self.uv[end] - self.uv[start], axis=1)
        stretch = np.divide(uv_length, length, out=np.zeros_like(length), where=length > 0)
        usual = np.quantile(stretch.reshape(-1, self.k), QUARTILE, axis=1, method="lower")
        torn = (length > 0) & (uv_length > SPANNING_LENGTH * square_side(self.uv))
        torn &= stretch > SPANNING_STRETCH * np.minimum(usual[start], usual[end])
        return np.asarray(torn.reshape(-1, self.k).any(axis=1))


def point_map(cloud: PointCloud, parameterization: PointParameterization) -> PointMap:
    """The points of `cloud` that have a uv, with their images.

    Raises:
        InputError: the numbers of points differ, or there are fewer than four.
    """
    points, uv = cloud.points, parameterization.uv
    if len(points) != len(uv):
        raise InputError(f"{len(uv)} uv rows for a cloud of {len(points)} points")
    if len(points) < 4:
        raise InputError(f"a cloud of {len(points)} points has no neighbourhoods; 4 are needed")
    covered = parameterization.covered
    if covered.sum() < 4:
        raise InputError(f"the map has a place for {covered.sum()} points; 4 are needed")
    points, uv, share = points[covered], uv[covered], float(covered.mean())
    return PointMap(points / power_above(points), uv / power_above(uv), share)


def nearest_others(tree: cKDTree, k: int) -> IntArray:
    """(P, k) for each point of the tree the k nearest other points, nearest first."""
    points = tree.data
    group = places(points)
    size = np.bincount(group)
    if size.max() <= k + 1:
        found = tree.query(points, k + 1)[1]
    else:
        # In a crowd at one place any others are nearest. A tree of all would compare each to each.
        order = np.argsort(group, kind="stable")
        first = np.cumsum(size) - size
        rank = np.empty(len(points), dtype=np.int64)
        rank[order] = np.arange(len(points)) - first[group[order]]
        kept = np.flatnonzero(rank <= k)
        few = cKDTree(points[kept])
        found = kept[few.query(points, k + 1)[1]]
        crowded = np.flatnonzero(size[group] > k + 1)
        step = (rank[crowded, None] + np.arange(k + 1)) % size[group[crowded], None]
        found[crowded] = order[first[group[crowded], None] + step]
    # A point heads its own list, unless another point lies at the same place. It is taken out
    # wherever it is; where it is not in the list at all, the last entry goes.
    own = found == np.arange(len(found))[:, None]
    own[~own.any(axis=1), -1] = True
    return np.asarray(found[~own].reshape(len(found), k), dtype=np.int64)


def local_quasi_conformal_mean(point_map: PointMap) -> float:
    """Mean of sigma1/sigma2 of the local Jacobians of rank 2."""
    return mean(_quasi_conformal(point_map))


def local_quasi_conformal_mean_without_spanning(point_map: PointMap) -> float:
    """The same over the points where the map does not tear."""
    return mean(_quasi_conformal(point_map)[~point_map.spanning])


def _quasi_conformal(point_map: PointMap) -> FloatArray:
    larger, smaller = point_map.singular_values.T
    ratio = np.full(len(larger), np.inf)
    np.divide(larger, smaller, out=ratio, where=smaller > larger * 1e-12)
    return ratio


def local_area_log_ratio_mean(point_map: PointMap) -> float:
    """Mean of abs(log(sigma1 sigma2) - its median) of the local Jacobians of rank 2."""
    return mean(_area_log_ratio(point_map))


def local_area_log_ratio_mean_without_spanning(point_map: PointMap) -> float:
    """The same over the points where the map does not tear."""
    return mean(_area_log_ratio(point_map)[~point_map.spanning])


def _area_log_ratio(point_map: PointMap) -> FloatArray:
    larger, smaller = point_map.singular_values.T
    known = smaller > larger * 1e-12
    ratio = np.full(len(larger), np.inf)
    log = np.log(larger[known]) + np.log(smaller[known])
    # Without areas there is no total to scale by; the median of the logarithms takes its place.
    ratio[known] = np.abs(log - np.median(log)) if known.any() else log
    return ratio


def _local_ratio(point_map: PointMap) -> FloatArray:
    """(P,) the local area, sigma1 sigma2, over the mean of all.

    It is nan where the points around span no plane. It is nan, too, where the map tears and the
    local area is above the median: the sides of a seam lie far apart in UV, and the space between
    them would make all other areas look small. A place that is squeezed along one direction also
    looks torn, but its local area is small, so it stays.
    """
    larger, smaller = point_map.singular_values.T
    area = np.where(larger > 0, larger * smaller, np.nan)
    if not (larger > 0).any():
        return area
    area[point_map.spanning & (area > np.nanmedian(area))] = np.nan
    total = np.nanmean(area)
    return area / total if total > 0 else np.full(len(area), np.nan)


def starved_point_fraction(point_map: PointMap) -> float:
    """Share of the points with a local area below a quarter of the mean; 1 if none has any."""
    ratio = _local_ratio(point_map)
    known = np.isfinite(ratio)
    return float((ratio[known] < STARVED).mean()) if known.any() else 1.0


def point_part_area_ratio_min(point_map: PointMap) -> float:
    """Smallest mean ratio of a connected part of starved points that holds at least 1 % of all.

    Points are connected to their neighbours in space. 1 where there is no such part.
    """
    ratio = _local_ratio(point_map)
    starved = ratio < STARVED
    if not starved.any():
        return 1.0
    near = point_map.neighbours
    start, end = np.repeat(np.arange(len(ratio)), near.shape[1]), near.reshape(-1)
    kept = starved[start] & starved[end]
    links = sparse.coo_matrix(
        (np.ones(kept.sum(), bool), (start[kept], end[kept])), [len(ratio)] * 2
    )
    label = csgraph.connected_components(links, directed=False)[1][starved]
    count, total = np.bincount(label), np.bincount(label, ratio[starved])
    large = count >= max(LEAST_PART * len(ratio), 1)
    return float((total[large] / count[large]).min(initial=1.0))


def neighbour_trustworthiness(point_map: PointMap) -> float:
    """1 if all neighbours in UV are neighbours in space too, else less (Venna and Kaski 2001)."""
    return _rank_agreement(point_map.uv_neighbours, point_map.neighbours, point_map.tree)


def neighbour_continuity(point_map: PointMap) -> float:
    """1 if all neighbours in space are neighbours in UV too, else less (Venna and Kaski 2001)."""
    return _rank_agreement(point_map.neighbours, point_map.uv_neighbours, point_map.uv_tree)


def neighbour_preservation(point_map: PointMap) -> float:
    """The smaller of trustworthiness and continuity."""
    return min(neighbour_trustworthiness(point_map), neighbour_continuity(point_map))


def _rank_agreement(found: IntArray, expected: IntArray, tree: cKDTree) -> float:
    """1 - 2 / (n k (2n - 3k - 1)) times the sum of (rank - k) over `found` but not `expected`.

    The rank is that among all points by distance in `tree`. 1 where a cloud is too small for the
    formula.

    Args:
        found: (P, k) for each point, the neighbours of the one kind.
        expected: (P, k) its neighbours of the other kind.
        tree: the points in the space in which `expected` are nearest.
    """
    count, k = found.shape
    if 2 * count - 3 * k - 1 <= 0:
        return 1.0
    asked = np.arange(0, count, -(-count // RANKED_POINTS))
    stranger = ~(found[asked, :, None] == expected[asked, None, :]).any(axis=2)
    row, column = np.nonzero(stranger)
    centre = tree.data[asked[row]]
    distance = np.linalg.norm(tree.data[found[asked[row], column]] - centre, axis=1)
    # The number of points within the distance, the point itself among them, is the rank plus 1.
    # The distance is rounded; a little more of it makes sure that the stranger is among them.
    distance *= 1 + 1e-12

    def excess(chosen: IntArray) -> FloatArray:
        within = tree.query_ball_point(centre[chosen], distance[chosen], return_length=True)
        return np.asarray(np.maximum(np.asarray(within, dtype=np.float64) - 1 - k, 1))

    chosen = np.arange(len(row))
    if len(row) > PROBES:
        probed = excess(np.linspace(0, len(row) - 1, PROBES).astype(np.int64)).mean()
        most = max(int(COUNTED / probed), PROBES)
        if most < len(row):
            chosen = np.linspace(0, len(row) - 1, most).astype(np.int64)
    total = excess(chosen).sum() * (len(row) / max(len(chosen), 1))
    return float(1 - 2 * total / (len(asked) * k * (2 * count - 3 * k - 1)))


def uv_collision_fraction(point_map: PointMap) -> float:
    """Fraction of the points whose nearest image is that of a point far away on the surface.

    There the map lays one sheet of the surface on another. Far away is more than SPANNING_STRETCH
    times the distance to the k-th neighbour.
    """
    points = point_map.points
    nearest = point_map.uv_neighbours[:, 0]
    distance = np.linalg.norm(points[nearest] - points, axis=1)
    reach = np.linalg.norm(points[point_map.neighbours[:, -1]] - points, axis=1)
    return float((distance > SPANNING_STRETCH * reach).mean())


def seam_point_fraction(point_map: PointMap) -> float:
    """Fraction of the points with one of their 3 nearest more than 1 % of L away in UV (ParaPoint).

    L is the side of the square bounding box of the map. The threshold is meant for dense clouds:
    from some 50,000 points on, only pairs across a seam exceed it.
    """
    near = point_map.neighbours[:, :SEAM_NEIGHBOURS]
    distance = np.linalg.norm(point_map.uv[near] - point_map.uv[:, None], axis=2).max(axis=1)
    return float((distance > SPANNING_LENGTH * square_side(point_map.uv)).mean())


def spanning_point_fraction(point_map: PointMap) -> float:
    """Fraction of the points between which and a neighbour the map tears."""
    return float(point_map.spanning.mean())
