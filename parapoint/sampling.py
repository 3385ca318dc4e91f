"""Points drawn from surfaces: those that a map is fitted to, of the faces, of the convex hull."""

from __future__ import annotations

import logging
import math

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from parapoint.errors import InputError
from parapoint.surface import FloatArray, IntArray, Mesh, Surface, twin_halfedges, unit_normals

logger = logging.getLogger("parapoint")

FEWEST_POINTS = 100
"""Distinct points that a fit needs."""
FEWEST_VERTICES = 2_000
LARGEST_BEND = math.radians(15)
"""A mesh of fewer vertices, or with a larger mean bend from face to face, is coarse: its vertices
alone do not show it, so points of its faces are added. Of models with more the mean bend is 1 to
10 degrees on 37 and 15 to 28 on nine; fits to their vertices flipped 2 to 41 % of the faces on
seven of these."""
CANDIDATES = 6
"""Points from which each one on a face is chosen."""
PACKED = 0.66
"""Least distance of a point on a face from all others, over the root of the mean area of a point:
some 1.15 times as many as are asked for would fit."""
MOST_COMPARED = 1_000_000
"""Rows of a cloud among which repetitions are counted."""


def training_points(surface: Surface, count: int, seed: int) -> FloatArray:
    """(n, 3) distinct training points: at most `count`, drawn evenly without repetition.

    Of a cloud, from its points; of a mesh, from the vertices of its faces, as in the paper's
    supplement. A coarse mesh, with fewer than 2,000 of them or bends of more than 15 degrees in the
    mean, gives its vertices and points spread evenly on its faces, `count` in all.

    Raises:
        InputError: fewer than 100 distinct points, or all on a line.
    """
    rng = np.random.default_rng(seed)
    if isinstance(surface, Mesh):
        points = surface.vertices[surface.referenced]
        if len(points) < count and _is_coarse(surface) and surface.face_areas.sum() > 0:
            points = even_sample(surface, count, seed)
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


def _is_coarse(mesh: Mesh) -> bool:
    """Whether the vertices of a mesh alone do not show its shape."""
    if mesh.referenced.sum() < FEWEST_VERTICES:
        return True
    normals = unit_normals(mesh.vertices, mesh.faces)
    one, other = (halfedge // 3 for halfedge in twin_halfedges(mesh.edge_of_halfedge))
    cosine = np.abs((normals[one] * normals[other]).sum(axis=1))  # faces may turn either way
    return len(cosine) > 0 and bool(np.arccos(np.minimum(cosine, 1)).mean() > LARGEST_BEND)


def even_sample(mesh: Mesh, count: int, seed: int) -> FloatArray:
    """(n, 3) the distinct vertices of a mesh, and points spread evenly on its faces up to `count`.

    None of these is near another point: of random candidates, one after another, those stay that
    have none within a radius (dart throwing; Cook 1986, "Stochastic sampling in computer
    graphics").
    """
    vertices = np.unique(mesh.vertices[mesh.referenced], axis=0)
    candidates = surface_sample(mesh.vertices, mesh.faces, CANDIDATES * count, seed)
    radius = PACKED * np.sqrt(mesh.face_areas.sum() / count)
    # Vertices first, and apart: of a small part with many of them all pairs would be too many.
    candidates = candidates[cKDTree(vertices).query(candidates)[0] > radius]
    earlier, later = cKDTree(candidates).query_pairs(radius, output_type="ndarray").T
    order = np.argsort(later, kind="stable")
    stays = [True] * len(candidates)
    for i, j in zip(earlier[order].tolist(), later[order].tolist(), strict=True):
        if stays[i]:
            stays[j] = False
    added = candidates[stays][: max(0, count - len(vertices))]
    return np.concatenate([vertices, added])


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
