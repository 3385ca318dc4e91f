"""Rows of a cloud that no map is fitted to: not finite, repeated, or stray.

Stray points lie far from everything else, as flying pixels and no-data rows do.
"""

from __future__ import annotations

import logging

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.scan_lines import breadth
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh, PointCloud, Surface

APART = 30.0
"""Sides of the cells, in typical spacings, through which points hang together. Lines of a scan
that lie thirty times as far apart as their points still do."""
NEAREST = 6
"""The distance to the neighbour of this rank, its median over the points, is the spacing."""
FEW, FEW_SHARE = 10, 0.005
"""A group of points is stray if it has no more points than the larger of this number and share."""
CLUMP_SHARE = 0.05
"""A group of up to this share of the points is stray as well if it lies CLUMP_RADII away."""
CLUMP_RADII = 10.0
"""Distance from the middle of the largest group, in half diagonals of the box around that one."""
MOST = 0.1
"""If a larger share of the places is in such groups, they are how the cloud is sampled."""
CLOUD_SHARE = 0.25
"""A group of up to this share of the places is stray wherever it lies if it is no surface: if most
of its points are LOOSE, or spread in all directions alike."""
MOST_SHAPELESS = 0.5
"""If a larger share of the places is in stray groups of either kind, none of it is left out."""
LOOSE = 5.0
"""Distance to the neighbour of rank NEAREST at which a point is loose, in typical spacings."""
ALONE = 3.5
"""A single place is stray if its distance to the nearest other is more than this times the distance
to the neighbour of rank NEAREST, both at each of the SURROUNDING nearest places and at the share
CLOSE of all places. The largest such ratio is 1.3 among the vertices or points of 67 models. Of
1,147 parts of these, some a hundred times sparser on one side, two lose a point each."""
SURROUNDING, CLOSE = 128, 0.98
SCATTERED = 0.2
"""A place whose distance to the neighbour of rank NEAREST is more than ALONE typical spacings is
scattered if the AROUND nearest places spread in their narrowest direction at least this much of how
they do in their widest: 95 of 100 such places of noise in a box, 0 to 26 of 100 on scans."""
MOST_SCATTERED, BESIDE = 2 / 3, 0.6
"""Places so far from others are strays where more than FEW of them, and more than the first share,
are scattered, and the second share of these is beside a surface: the distance of a place around is
ALONE times smaller, as it is for noise and is not in a part that is only sparse. No whole scan or
surface of ours loses any; half of one, sampled a hundred times more sparsely, may lose it."""
ON_LINES = 1_000
"""Nearest places that tell whether a single place lies beside lines of a scan, where it stays."""
AROUND = 16
"""Points whose spread tells how thick a group is."""
THICK, THIN = 2.0, 0.2
"""A group that is no surface is at least this much thicker than the largest, and than this."""
SAMPLED = 5_000
"""Points whose spacing is looked at."""
LARGEST = 1e12
"""Coordinates count as no larger than this, in the median distance from the middle."""

NAMED = 10
"""Stray rows that are named one by one."""
MOST_COMPARED = 1_000_000
"""Rows of a cloud among which repetitions are counted."""

logger = logging.getLogger("parapoint")


def fitted_rows(given: npt.ArrayLike | Surface) -> tuple[Surface, dict[str, object]]:
    """The surface without the rows that no map is fitted to, and how many those are, as facts.

    A mesh stays as it is. Repeated rows stay too: the draw of points takes one of them.

    Args:
        given: a mesh, a cloud, or the (n, 3) points of one.

    Raises:
        InputError: the array has another shape, or no finite row.
    """
    surface = given if isinstance(given, Mesh | PointCloud) else _finite(given)
    surface, strays = without_strays(surface)
    if isinstance(surface, Mesh):
        return surface, {"dropped_not_finite": 0, "dropped_duplicates": 0}
    points = surface.points[:MOST_COMPARED]
    ordered = points[np.lexsort(points.T)]
    repeated = int((ordered[1:] == ordered[:-1]).all(axis=1).sum())
    if repeated:
        which = "the first " if len(points) < len(surface.points) else ""
        logger.warning(
            "%d of %s%d points repeat others and count once", repeated, which, len(points)
        )
    return surface, {
        "dropped_not_finite": surface.dropped,
        "dropped_duplicates": repeated,
        **strays,
    }


def _finite(given: npt.ArrayLike) -> PointCloud:
    """The cloud of the finite rows of an array; the number of others is logged."""
    try:
        points = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"points must be numbers: {error}") from None
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), not {points.shape}")
    finite = np.isfinite(points).all(axis=1)
    dropped = int((~finite).sum())
    if dropped:
        logger.warning("dropped %d of %d points: not finite", dropped, len(points))
    rows = np.flatnonzero(finite) if dropped else None
    return PointCloud(points[finite], dropped=dropped, rows=rows)


def without_strays(surface: Surface) -> tuple[Surface, dict[str, object]]:
    """The surface without the stray points of a cloud; their number and first rows, as facts.

    A warning names their rows, numbered from 0, of the file or array that was given.
    """
    if isinstance(surface, Mesh):
        return surface, {}
    is_stray = stray_points(surface.points)
    rows = surface.rows_of(np.flatnonzero(is_stray))
    if len(rows) == 0:
        return surface, {"strays": 0}
    logger.warning(
        "%d of %d points lie far from all others and are mapped nowhere: row%s %s",
        len(rows),
        len(surface.points),
        "s" * (len(rows) > 1),
        named(rows),
    )
    facts = {"strays": len(rows), "stray_rows": rows[:NAMED].tolist()}
    return surface.chosen(~is_stray), facts


def named(rows: IntArray) -> str:
    """The first NAMED of some row numbers (n,), for a message."""
    return ", ".join(map(str, rows[:NAMED].tolist())) + ", ..." * (len(rows) > NAMED)


def unmapped(surface: Surface, uv: FloatArray, known: FloatArray | None = None) -> FloatArray:
    """The map (P, 2) of a surface's points with NaN at the stray ones.

    Args:
        surface: a mesh, of which no vertex is stray, or a cloud.
        uv: its map.
        known: (n, 3) points that the map was fitted to, where it was to another cloud: a point
            beside these is none of its strays, however far it lies from its own cloud.
    """
    if isinstance(surface, Mesh) or not (is_stray := stray_points(surface.points)).any():
        return uv
    if known is not None:
        is_stray[is_stray] = ~are_near(known, surface.points[is_stray])
    uv = uv.copy()
    uv[is_stray] = np.nan
    return uv


def are_near(known: FloatArray, points: FloatArray) -> BoolArray:
    """(N,) whether points (N, 3) are nearer to known ones (n, 3) than any single stray point is."""
    tree = cKDTree(known)
    looked_at = known[:: len(known) // SAMPLED + 1]
    spacing = np.median(tree.query(looked_at, min(NEAREST + 1, len(known)))[0][:, -1])
    with np.errstate(over="ignore"):
        distance = tree.query(points, distance_upper_bound=ALONE * spacing)[0]
    return np.asarray(np.isfinite(distance))


def far_from(known: FloatArray, points: FloatArray) -> BoolArray:
    """(N,) whether points (N, 3) are stray beside the points (n, 3) of a surface.

    They are if they lie outside the ball around the surface, and farther from all of its points
    than APART times the spacing of these, or than the radius of the ball.
    """
    frame = Frame.of(known)
    with np.errstate(over="ignore"):
        is_far: BoolArray = np.abs(frame.inside(points)).max(axis=1, initial=0) > 1
        if is_far.any():
            tree = cKDTree(known)
            looked_at = known[:: len(known) // SAMPLED + 1]
            nearest = tree.query(looked_at, min(NEAREST + 1, len(known)))[0][:, -1]
            reach = min(APART * float(np.median(nearest)), frame.scale)
            is_far[is_far] = ~np.isfinite(tree.query(points[is_far], distance_upper_bound=reach)[0])
    return is_far


def stray_points(points: FloatArray) -> BoolArray:
    """(P,) whether each of the points (P, 3) is a stray one."""
    centred = points / 2 - np.median(points, axis=0) / 2  # halves: their difference cannot overflow
    size = float(np.median(np.abs(centred).max(axis=1))) or float(np.abs(centred).max())
    if size == 0:
        return np.zeros(len(points), dtype=bool)
    with np.errstate(over="ignore"):
        scaled = np.clip(centred / size, -LARGEST, LARGEST)
    places, place = np.unique(scaled, axis=0, return_inverse=True)
    if len(places) <= NEAREST + 1:
        return np.zeros(len(points), dtype=bool)
    tree = cKDTree(places)
    spacings = _spacings(tree)
    spacing = float(np.median(spacings))
    cells, cell = np.unique(
        np.floor(places / (APART * spacing)).astype(np.int64), axis=0, return_inverse=True
    )
    pairs = cKDTree(cells.astype(np.float64)).query_pairs(
        1.8, output_type="ndarray"
    )  # with corners
    links = coo_matrix((np.ones(len(pairs), dtype=bool), pairs.T), (len(cells),) * 2)
    group = connected_components(links, directed=False)[1][cell.reshape(-1)]
    count = np.bincount(group)
    largest = int(count.argmax())
    few = max(FEW, FEW_SHARE * len(places))
    clumped = (count <= CLUMP_SHARE * len(places)) & _far_groups(places, group, count)
    is_stray = ((count <= few) | clumped) & (np.arange(len(count)) != largest)
    shapeless = np.zeros(len(count), dtype=bool)
    for small in np.flatnonzero((count <= CLOUD_SHARE * len(places)) & (count < count[largest])):
        of_group = places[group == small]
        shapeless[small] = _is_loose(places, of_group, spacing) or (
            _thickness(of_group) > THICK * max(_thickness(places[group == largest]), THIN)
        )
    if is_stray[group].mean() > MOST:
        is_stray[:] = False
    if (is_stray | shapeless)[group].mean() <= MOST_SHAPELESS:
        is_stray |= shapeless
    stray_places = is_stray[group]
    far = np.flatnonzero(spacings > ALONE * spacing)
    stray_places[_scattered(tree, far[~stray_places[far]], spacings)] = True
    stray_places[_alone(tree, far, spacings, most=int(few))] = True
    return np.asarray(stray_places[place.reshape(-1)])


def _spacings(tree: cKDTree) -> FloatArray:
    """(N,) the distance of each place of a tree to its neighbour of rank NEAREST."""
    order = tree.indices  # places that are near each other in a row: three times as fast
    found = np.empty(len(order))
    found[order] = tree.query(np.asarray(tree.data)[order], [NEAREST + 1])[0][:, 0]
    return found


def _scattered(tree: cKDTree, far: IntArray, spacings: FloatArray) -> IntArray:
    """Those of some places that are strewn through space beside a surface; none if most are not.

    Args:
        tree: the places.
        far: rows of those that may be.
        spacings: (N,) of all places.
    """
    if len(far) <= FEW or len(spacings) <= AROUND:
        return far[:0]
    near = tree.query(tree.data[far], AROUND)[1]
    narrow, _, wide = _spread(np.asarray(tree.data), near).T
    is_scattered = narrow > SCATTERED * wide
    is_beside = spacings[far] > ALONE * spacings[near].min(axis=1)
    count = int(is_scattered.sum())
    is_noise = max(FEW, MOST_SCATTERED * len(far)) < count <= CLOUD_SHARE * len(spacings)
    if not is_noise or is_beside[is_scattered].mean() < BESIDE:
        return far[:0]
    return np.asarray(far[is_scattered | is_beside])


def _alone(tree: cKDTree, far: IntArray, spacings: FloatArray, most: int) -> IntArray:
    """Rows of the single places that are far from all others; none if there are more than `most`.

    Args:
        tree: the places.
        far: rows of those that may be alone.
        spacings: (N,) of all places.
        most: so many may be alone; if there are more, they are how the cloud is sampled.
    """
    places = np.asarray(tree.data)
    reach = ALONE * float(np.quantile(spacings, CLOSE))
    lone: IntArray = far[
        np.isinf(tree.query(places[far], [2], distance_upper_bound=reach)[0][:, 0])
    ]
    if len(lone) > most:
        return lone[:0]
    found = []
    for row in lone:
        distance, near = tree.query(places[row], min(ON_LINES, len(places)))
        local = float(spacings[near[1 : SURROUNDING + 1]].max())
        if distance[1] > ALONE * local and breadth(places[near[1:]]) is None:
            found.append(row)
    return np.array(found, dtype=np.int64)


def _is_loose(places: FloatArray, some: FloatArray, spacing: float) -> bool:
    """Whether most of some points (n, 3) are far from the nearest others, too."""
    rank = min(NEAREST + 1, len(places))
    distance = cKDTree(places).query(some[:: len(some) // SAMPLED + 1], [rank])[0]
    return float(np.median(distance)) > LOOSE * spacing


def _thickness(points: FloatArray) -> float:
    """How little points (N, 3) spread like a surface: 0 in a plane, 1 alike in all directions."""
    if len(points) <= AROUND:
        return 0.0
    some = points[:: len(points) // SAMPLED + 1]
    narrow, middle, _ = _spread(points, cKDTree(points).query(some, AROUND)[1]).T
    return float(np.median(narrow / np.maximum(middle, 1e-150)))


def _spread(points: FloatArray, near: IntArray) -> FloatArray:
    """(N, 3) how far some of the points (P, 3) spread in three directions, the narrowest first.

    Args:
        points: all points.
        near: (N, k) rows of those whose spread is wanted.
    """
    offsets = points[near] - points[near].mean(axis=1, keepdims=True)
    squares = np.linalg.eigvalsh(np.einsum("nki,nkj->nij", offsets, offsets))
    return np.asarray(np.sqrt(np.maximum(squares, 0)))


def _far_groups(places: FloatArray, group: IntArray, count: IntArray) -> BoolArray:
    """(G,) whether the mean place of each group lies CLUMP_RADII from the largest group's middle.

    Args:
        places: (N, 3) the points.
        group: (N,) the group of each.
        count: (G,) points of each group.
    """
    largest = places[group == count.argmax()]
    low, high = largest.min(axis=0), largest.max(axis=0)
    means = np.stack([np.bincount(group, column) / count for column in places.T], axis=1)
    away = np.linalg.norm(means - (low + high) / 2, axis=1)
    is_far: BoolArray = away > CLUMP_RADII * np.linalg.norm(high - low) / 2
    return is_far
