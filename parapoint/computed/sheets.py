"""Sheets of a bare cloud that cross: a normal of each point's own sheet, and triangles along it.

No complex of tetrahedra holds both of two sheets that cross: where one runs through a triangle of
the other, this triangle is not in it. Normals tell the sheets apart. That of a point is the one
most of its Delaunay triangles agree on, weighted by their angles there, then fitted to the
neighbours on its sheet. It is turned as the faces of a triangulation that does not cross are, where
these lie along it, elsewhere as its neighbours. The triangles are Delaunay in each point's sheet
alone (as in Gopi, Krishnan and Silva 2000, "Surface reconstruction based on lower dimensional
localized Delaunay triangulation").
"""

from __future__ import annotations

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import cKDTree

from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, edge_table, unit_normals

AGREEMENT = 4
"""Triangles at a point agree on a normal by this power of the cosine between theirs and it."""
LIKENESS = 8
"""What two normals say of each other's sign counts by this power of the cosine between them."""
TURN_RISE = 0.2
"""Sine of the angle between a link and the planes of its ends at which it counts 1/e for signs."""
RISE = 0.4
"""Sine of the angle by which a neighbour on the sheet of a point may rise from its plane."""
FIT_NEIGHBOURS, FIT_AGREEMENT, FIT_RISE = 12, 0.7, 0.3
"""Points on the sheet that its normal is fitted to, the least cosine between their normals and its,
and the rise at which their weight falls to 1/e."""
SHEET_NEIGHBOURS, SHEET_AGREEMENT = 18, 0.8
"""Points on the sheet that may be in the ball of a triangle, and the least cosine there."""
CORNERS = 12
"""So many of the nearest points of a point's sheet are tried as corners of its triangles."""
NEAREST = 64
"""Points among which those on the sheet are sought: the other sheet may be much denser."""
LOOSEST = 1.5
"""Largest circumradius of a triangle, in mean distances to the nearest six points on the sheet."""


def sheet_normals(
    points: FloatArray, triangles: IntArray, radius: FloatArray, mesh: Mesh
) -> FloatArray:
    """(N, 3) unit normals of the sheets of points (N, 3), turned as the faces of `mesh`.

    Args:
        points: distinct.
        triangles: (T, 3) Delaunay triangles with small empty balls.
        radius: (T,) of these balls.
        mesh: an oriented triangulation of the points.
    """
    normals = _fitted(points, _agreed(points, triangles, radius))
    return normals * _signs(points, normals, triangles, mesh)[:, None]


def sheet_triangles(points: FloatArray, normals: FloatArray) -> tuple[IntArray, FloatArray]:
    """Triangles (T, 3) along the sheets of points (N, 3) with unit normals, and their radii (T,).

    Their circumballs hold no other point of the sheet, as seen from two corners at least.
    """
    near, distance = _on_sheet(points, normals, SHEET_NEIGHBOURS, SHEET_AGREEMENT)
    known = near[:, :6] >= 0
    total = np.where(known, distance[:, :6], 0).sum(axis=1)
    reach = LOOSEST * total / np.maximum(known.sum(axis=1), 1)
    found = [np.zeros((0, 3), dtype=np.int64)]
    radii = [np.zeros(0)]
    second, third = np.triu_indices(CORNERS, 1)
    for rows in np.array_split(np.arange(len(points)), len(points) // 4000 + 1):
        i = np.repeat(rows, len(second))
        j, k = (near[rows][:, at].reshape(-1) for at in (second, third))
        given = (j >= 0) & (k >= 0)
        i, j, k = i[given], j[given], k[given]
        p, q = points[j] - points[i], points[k] - points[i]
        normal = np.cross(p, q)
        squared = np.maximum((normal**2).sum(axis=1, keepdims=True), 1e-300)
        pp, qq = ((edge**2).sum(axis=1, keepdims=True) for edge in (p, q))
        offset = (np.cross(normal, p) * qq + np.cross(q, normal) * pp) / (2 * squared)
        radius = np.linalg.norm(offset, axis=1)
        unit = normal / np.sqrt(squared)
        agrees = [np.abs((unit * normals[at]).sum(axis=1)) > SHEET_AGREEMENT for at in (i, j, k)]
        fits = np.flatnonzero((radius < reach[i]) & np.all(agrees, axis=0))
        i, j, k, offset, radius = i[fits], j[fits], k[fits], offset[fits], radius[fits]
        empty = np.ones(len(i), dtype=bool)
        for other in near[i].T:
            apart = np.linalg.norm(points[other] - points[i] - offset, axis=1)
            inside = (apart < radius * (1 - 1e-9)) & (other >= 0)
            empty &= ~inside | (other == j) | (other == k)
        found.append(np.sort(np.stack([i, j, k], axis=1)[empty], axis=1))
        radii.append(radius[empty])
    triangles, row, seen = np.unique(
        np.concatenate(found), axis=0, return_index=True, return_counts=True
    )
    return triangles[seen > 1], np.concatenate(radii)[row[seen > 1]]


def _agreed(points: FloatArray, triangles: IntArray, radius: FloatArray) -> FloatArray:
    """(N, 3) the normals that most triangles (T, 3) at each point agree on, 0 where there are none.

    They count by their angle there over the radius (T,) of their ball.
    """
    corner = triangles.reshape(-1)
    order = np.argsort(corner, kind="stable")
    at, normal = corner[order], unit_normals(points, triangles)[order // 3]
    weight = (igl.internal_angles(points, triangles) / radius[:, None]).reshape(-1)[order]
    count = np.bincount(at, minlength=len(points))
    size = count[at]
    one = np.repeat(np.arange(len(at)), size)
    place = np.arange(len(one)) - np.repeat(np.cumsum(size) - size, size)
    other = (np.cumsum(count) - count)[at[one]] + place
    agreement = (normal[one] * normal[other]).sum(axis=1) ** AGREEMENT * weight[other]
    best = np.lexsort((-np.bincount(one, agreement, len(at)), at))
    held, first = np.unique(at[best], return_index=True)
    agreed: FloatArray = np.zeros_like(points)
    agreed[held] = normal[best[first]]
    for _ in range(2):
        cosine = (normal * agreed[at]).sum(axis=1)
        turned = (weight * np.sign(cosine) * cosine**AGREEMENT)[:, None] * normal
        agreed = np.stack([np.bincount(at, of, len(points)) for of in turned.T], axis=1)
        agreed /= np.maximum(np.linalg.norm(agreed, axis=1, keepdims=True), 1e-300)
    return agreed


def _fitted(points: FloatArray, normals: FloatArray) -> FloatArray:
    """(N, 3) normals of planes through the points, fitted to those on their sheets."""
    near, distance = _on_sheet(points, normals, FIT_NEIGHBOURS, FIT_AGREEMENT)
    known = near >= 0
    along = (points[near] - points[:, None]) / np.where(known, distance, 1)[:, :, None]
    rise = (along * normals[:, None]).sum(axis=2)
    weight = known * np.exp(-((rise / FIT_RISE) ** 2))
    scatter = np.einsum("nk,nki,nkj->nij", weight, along, along)
    least = np.linalg.eigh(scatter)[1][:, :, 0]
    return np.where((known.sum(axis=1) >= 4)[:, None], least, normals)


def _on_sheet(
    points: FloatArray, normals: FloatArray, count: int, agreement: float
) -> tuple[IntArray, FloatArray]:
    """The `count` nearest points on the sheet of each (N, count), -1 where missing, and how far."""
    most = min(NEAREST + 1, len(points))
    distance, near = (of[:, 1:] for of in cKDTree(points).query(points, most))
    offset = points[near] - points[:, None]
    rises = [np.abs((offset * of).sum(axis=2)) for of in (normals[:, None], normals[near])]
    cosine = np.abs((normals[:, None] * normals[near]).sum(axis=2))
    is_on = (np.maximum(*rises) < RISE * distance) & (cosine > agreement)
    order = np.argsort(~is_on, axis=1, kind="stable")[:, :count]
    is_on, near, distance = (np.take_along_axis(of, order, 1) for of in (is_on, near, distance))
    return np.where(is_on, near, -1), np.where(is_on, distance, np.inf)


def _signs(points: FloatArray, normals: FloatArray, triangles: IntArray, mesh: Mesh) -> FloatArray:
    """(N,) 1 or -1, by which the normals (N, 3) turn as the faces of `mesh` and their neighbours.

    The signs of the x that minimize Σ |b_ij| (x_i − sign(b_ij) x_j)² over the edges of the
    triangles (T, 3), plus Σ |a_i| (x_i − sign(a_i))², where a is a power of the cosine with the
    faces around, b of that between two normals mirrored across the bisector of their points, as
    those of a circle are; a link that leaves a plane says little.
    """
    faces, size = mesh.faces, len(points)
    cosine = (unit_normals(points, faces)[:, None] * normals[faces]).sum(axis=2)
    angle = igl.internal_angles(points, faces)
    around = [
        np.bincount(faces.reshape(-1), of.reshape(-1), size) for of in (angle, angle * cosine)
    ]
    own = _powered(around[1] / np.maximum(around[0], 1e-300))
    i, j = edge_table(triangles)[0].T
    along = points[j] - points[i]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    rises = [(normals[end] * along).sum(axis=1) for end in (i, j)]
    mirrored = (normals[i] * normals[j]).sum(axis=1) - 2 * rises[0] * rises[1]
    bond = _powered(mirrored) * np.exp(-((np.abs(rises).max(axis=0) / TURN_RISE) ** 2))
    links = sparse.coo_matrix((bond, (i, j)), (size, size)).tocsr()
    links = links + links.T
    weight = np.abs(own) + np.asarray(np.abs(links).sum(axis=1)).reshape(-1) + 1e-9
    x, _ = cg(sparse.diags_array(weight) - links, own, M=sparse.diags_array(1 / weight))
    return np.where(x < 0, -1.0, 1.0)


def _powered(cosine: FloatArray) -> FloatArray:
    """The power of a cosine by which it counts, with its sign."""
    return np.asarray(np.sign(cosine) * np.abs(cosine) ** LIKENESS)
