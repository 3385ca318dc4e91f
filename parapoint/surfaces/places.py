"""Which points lie at one place: writers of meshes double vertices where anything differs."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

SAME_PLACE = 1e-7
"""Two points are at one place if they are no farther apart than this share of the diagonal of their
bounding box. Most writers compute in single precision, which rounds by about as much."""
CROWD = 32
"""Neighbours within the tolerance, on average, that `places` looks at one by one."""


def places(points: npt.NDArray[np.float64], tolerance: float = 0.0) -> npt.NDArray[np.int64]:
    """(N,) the number of the place, from 0, at which each of (N, k) points lies.

    Args:
        points: coordinates.
        tolerance: two points are at one place if none of their coordinates differ by more than
            this, or if a chain of such points joins them. Where more than `CROWD`
            others are so near to a point on average, one point stands for those within half the
            tolerance, and takes in what is within 1.5 of it.
    """
    order = np.lexsort(points.T)
    ordered = points[order] + 0.0  # no negative zeros
    is_new = np.ones(len(points), dtype=bool)
    is_new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    place = np.empty(len(points), dtype=np.int64)
    place[order] = np.cumsum(is_new) - 1
    if tolerance <= 0:
        return place
    apart = ordered[is_new]
    tree, cell = cKDTree(apart), np.arange(len(apart))
    if tree.count_neighbors(tree, tolerance, p=np.inf) > (CROWD + 1) * len(apart):
        cell = places(np.floor((apart - apart.min(axis=0)) / (tolerance / 2)))
        apart = apart[np.unique(cell, return_index=True)[1]]
        tree, tolerance = cKDTree(apart), 1.5 * tolerance
    pairs = tree.query_pairs(tolerance, p=np.inf, output_type="ndarray")
    links = sparse.coo_matrix((np.ones(len(pairs), bool), pairs.T), [len(apart)] * 2)
    joined = csgraph.connected_components(links, directed=False)[1]
    return np.asarray(joined[cell[place]], dtype=np.int64)


def same_place(points: npt.NDArray[np.float64]) -> float:
    """The tolerance of `places` for (N, k) points, by SAME_PLACE, in the unit of the points."""
    return SAME_PLACE * math.hypot(*np.ptp(points, axis=0)) if len(points) else 0.0


def first_of_each(place: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """(N,) for each row of (N,) numbers of places, the first row with the same number."""
    _, first, number = np.unique(place, return_index=True, return_inverse=True)
    return np.asarray(first[number], dtype=np.int64)
