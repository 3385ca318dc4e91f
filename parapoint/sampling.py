"""Points drawn from surfaces: those that a map is fitted to, of the faces, of the convex hull."""

from __future__ import annotations

import logging

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from parapoint.errors import InputError
from parapoint.surface import FloatArray, IntArray, Mesh, Surface

logger = logging.getLogger("parapoint")

FEWEST_POINTS = 100
"""Distinct points that a fit needs."""
FEWEST_VERTICES = 2_000
"""A mesh of fewer vertices is sampled on its faces instead: its vertices alone do not show it."""
MOST_COMPARED = 1_000_000
"""Rows of a cloud among which repetitions are counted."""


def training_points(surface: Surface, count: int, seed: int) -> FloatArray:
    """(n, 3) distinct training points: at most `count`, drawn evenly without repetition.

    Of a cloud, from its points; of a mesh, from the vertices of its faces, or from the faces by
    area where it has fewer than 2,000 vertices.

    Raises:
        InputError: fewer than 100 distinct points, or all on a line.
    """
    rng = np.random.default_rng(seed)
    if isinstance(surface, Mesh):
        points = surface.vertices[surface.referenced]
        if len(points) < FEWEST_VERTICES and surface.face_areas.sum() > 0:
            points = surface_sample(surface.vertices, surface.faces, count, seed)
    else:
        points = surface.points
    if len(points) > 10 * count:
        # Repetitions are looked for in a part: sorting millions of rows takes long.
        points = points[np.sort(rng.choice(len(points), 10 * count, replace=False))]
    distinct = np.unique(points, axis=0)
    if len(distinct) < FEWEST_POINTS:
        raise InputError(f"{len(distinct)} distinct points; a fit needs at least {FEWEST_POINTS}")
    spread = np.linalg.svd(distinct - distinct.mean(axis=0), compute_uv=False)
    if spread[1] <= 1e-6 * spread[0]:
        raise InputError("all points lie on a line; a fit needs points of a surface")
    if len(distinct) > count:
        distinct = distinct[np.sort(rng.choice(len(distinct), count, replace=False))]
    return np.ascontiguousarray(distinct)


def rows_left_out(surface: Surface) -> dict[str, object]:
    """How many rows of a cloud were not finite, and how many repeat others (of a million)."""
    if isinstance(surface, Mesh):
        return {"dropped_not_finite": 0, "dropped_duplicates": 0}
    points = surface.points[:MOST_COMPARED]
    ordered = points[np.lexsort(points.T)]
    repeated = int((ordered[1:] == ordered[:-1]).all(axis=1).sum())
    if repeated:
        logger.warning("%d of %d points repeat others and count once", repeated, len(points))
    return {"dropped_not_finite": surface.dropped, "dropped_duplicates": repeated}


def hull_sample(points: FloatArray, count: int, seed: int) -> FloatArray:
    """(count, 3) points spread evenly by area over the convex hull of (N, 3) points.

    Points in a plane are their own hull's sample: they come back as they are.
    """
    try:
        hull = ConvexHull(points)
    except QhullError:
        return points
    return surface_sample(points, hull.simplices, count, seed)


def surface_sample(vertices: FloatArray, faces: IntArray, count: int, seed: int) -> FloatArray:
    """(count, 3) points spread evenly by area over the triangles (F, 3) of vertices (V, 3)."""
    rng = np.random.default_rng(seed)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rows = rng.choice(len(faces), size=count, p=area / area.sum())
    s, t = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
    return np.asarray((1 - s) * a[rows] + s * (1 - t) * b[rows] + s * t * c[rows])
