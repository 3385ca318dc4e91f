"""Points drawn from surfaces: those that a map is fitted to, of the faces, of the convex hull."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import ConvexHull, QhullError, cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.frame import power_of_two
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface, edge_table

FEWEST_POINTS = 100
"""Distinct points that a fit needs."""
SAMPLED_ANEW = 5 * FEWEST_POINTS
"""Points that are sought on the faces of a mesh where a sample fell short of that: on two sheets
that lie on one another there is room for 70 of 100."""
COINCIDENT = 1e-6
"""Points that agree to this, in radii of the surface, count as one."""
FEWEST_VERTICES = 2_000
"""A mesh of fewer vertices is coarse: these alone do not show its shape, so points of its faces are
added."""
NEAREST = 3
"""Nearest vertices of each one that are looked at on a mesh of more vertices."""
FAR = 0.005
"""Such a mesh is coarse as well if more than this share of the nearest vertices are more than two
edges away: then its vertices alone do not show where parts of it are apart. Of 43 models the share
is at most 0.24 % on 28, and 0.8 to 27 % on 15."""
CANDIDATES = 6
"""Points from which each one on a face is chosen."""
PACKED = 0.66
"""Least distance of a point on a face from all others, over the root of the mean area of a point:
some 1.15 times as many as are asked for would fit."""


def training_points(surface: Surface, count: int, seed: int) -> FloatArray:
    """(n, 3) distinct training points: at most `count`, drawn evenly without repetition.

    Of a cloud, from its points; of a mesh, from the vertices of its faces, as in the paper's
    supplement. A coarse mesh, whose vertices alone do not show its shape, gives these and points
    spread evenly on its faces, `count` together.

    Raises:
        InputError: fewer than 100 distinct points, or all on a line.
    """
    rng = np.random.default_rng(seed)
    if isinstance(surface, Mesh):
        points = surface.vertices[surface.referenced]
        if len(points) < count and points.any() and _is_coarse(surface):
            unit = power_of_two(points)  # in which areas are no larger or smaller than float64
            scaled = Mesh(surface.vertices / unit, surface.faces)
            if scaled.face_areas.sum() > 0:
                points = even_sample(scaled, count, seed) * unit
                if len(points) < FEWEST_POINTS:
                    points = even_sample(scaled, SAMPLED_ANEW, seed) * unit
    else:
        points = surface.points
    if len(points) > 10 * count:
        # Repetitions are looked for in a part: sorting millions of rows takes long.
        points = points[np.sort(rng.choice(len(points), 10 * count, replace=False))]
    distinct = np.unique(points, axis=0)
    if len(distinct) < FEWEST_POINTS:
        raise InputError(f"{len(distinct)} distinct points; a fit needs at least {FEWEST_POINTS}")
    scaled_points = distinct / power_of_two(distinct)
    spread = np.linalg.svd(scaled_points - scaled_points.mean(axis=0), compute_uv=False)
    if spread[1] <= 1e-6 * spread[0]:
        raise InputError("all points lie on a line; a fit needs points of a surface")
    if len(distinct) > count:
        distinct = distinct[np.sort(rng.choice(len(distinct), count, replace=False))]
    return np.ascontiguousarray(distinct)


def without_coincident(cloud: FloatArray) -> FloatArray:
    """(M, 3) the points (N, 3) of a cloud in its frame, without those that coincide with others."""
    _, rows = np.unique(np.round(cloud / COINCIDENT), axis=0, return_index=True)
    return cloud[np.sort(rows)]


def _is_coarse(mesh: Mesh) -> bool:
    """Whether the vertices of a mesh alone do not show its shape."""
    places, row = np.unique(mesh.vertices[mesh.faces.reshape(-1)], axis=0, return_inverse=True)
    if len(places) < FEWEST_VERTICES:
        return True
    i, j = edge_table(row.reshape(-1, 3))[0].T
    links = sparse.coo_matrix((np.ones(len(i), dtype=bool), (i, j)), (len(places),) * 2).tocsr()
    around = links + links.T + sparse.identity(len(places), dtype=bool, format="csr")
    near = cKDTree(places).query(places, NEAREST + 1)[1][:, 1:].reshape(-1)
    shared = around[np.repeat(np.arange(len(places)), NEAREST)].multiply(around[near])
    return bool((shared.sum(axis=1) == 0).mean() > FAR)


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


def mean_spacing(points: FloatArray) -> float:
    """Mean distance from each of (N, 3) points to its nearest other one."""
    return float(cKDTree(points).query(points, 2)[0][:, 1].mean())


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
