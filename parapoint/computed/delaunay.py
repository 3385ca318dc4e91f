"""The Delaunay complex of a bare cloud: its triangles, and which of its tetrahedra are inside.

The labels are found as in Kolluri, Shewchuk and O'Brien 2004 ("Spectral surface reconstruction from
noisy point clouds"), over all tetrahedra and by one linear solve in place of an eigenvector: two
whose balls overlap deeply are on one side of the surface; the two poles of a point, the centres of
the largest balls on either side of it, are on different sides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import Delaunay

from parapoint.surfaces.surface import FloatArray, IntArray

JOGGLE = 1e-4
"""Noise on the points that the complex sees, in spacings: it breaks ties."""
CONTRAST = 8.0
"""A bond is exp(CONTRAST · cosine of the angle at which two balls meet); 4 to 12 do as well."""
SOLVED = 1e-5
"""Relative residual at which the labels are solved."""
MOST_STEPS = 2000
"""Steps of conjugate gradients at most; some 200 are needed."""


class Complex(NamedTuple):
    """A Delaunay complex of N points and far corners of a box, which keep a plane 3-dimensional.

    Attributes:
        sites: (N + 8, 3) the points, slightly moved, and the corners.
        tetrahedra: (T, 4) rows of `sites`.
        neighbours: (T, 4) the tetrahedron across from each corner; -1 outside the box.
        centres: (T, 3) of the balls through the corners.
        radii: (T,) of these balls.
        triangles: (F, 3) rows of the points, ascending; those at the corners are left out.
        sides: (F, 2) the tetrahedra in front of each triangle, where its normal points, and behind.
    """

    sites: FloatArray
    tetrahedra: IntArray
    neighbours: IntArray
    centres: FloatArray
    radii: FloatArray
    triangles: IntArray
    sides: IntArray


def delaunay_complex(points: FloatArray, spacing: FloatArray) -> Complex:
    """The Delaunay complex of points (N, 3), whose distances are about `spacing` (N,).

    Raises:
        scipy.spatial.QhullError: Qhull gives up.
    """
    rng = np.random.default_rng(0)
    centre, reach = (points.max(axis=0) + points.min(axis=0)) / 2, np.ptp(points, axis=0).max()
    corner_signs = 2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1
    box = 3 * reach * (corner_signs + rng.uniform(-0.1, 0.1, (8, 3)))
    noise = JOGGLE * spacing[:, None] * rng.standard_normal(points.shape)
    sites = np.concatenate([points + noise - centre, box])
    found = Delaunay(sites)
    tetrahedra, neighbours = found.simplices.astype(np.int64), found.neighbors.astype(np.int64)
    centres = _circumcentres(sites[tetrahedra])
    radii = np.linalg.norm(centres - sites[tetrahedra[:, 0]], axis=1)
    triangles, sides = [], []
    for opposite in range(4):
        other = neighbours[:, opposite]
        once = np.flatnonzero(other > np.arange(len(tetrahedra)))
        triangle = np.sort(np.delete(tetrahedra[once], opposite, axis=1), axis=1)
        a, b, c, apex = (sites[rows] for rows in (*triangle.T, tetrahedra[once, opposite]))
        in_front = (np.cross(b - a, c - a) * (apex - a)).sum(axis=1) > 0
        pair = np.stack([once, other[once]], axis=1)
        triangles.append(triangle)
        sides.append(np.where(in_front[:, None], pair, pair[:, ::-1]))
    inner = (np.concatenate(triangles) < len(points)).all(axis=1)
    return Complex(
        sites,
        tetrahedra,
        neighbours,
        centres,
        radii,
        np.concatenate(triangles)[inner],
        np.concatenate(sides)[inner],
    )


def _circumcentres(corners: FloatArray) -> FloatArray:
    """(T, 3) centres of the balls through the corners (T, 4, 3) of tetrahedra."""
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    half = [(edge**2).sum(axis=1, keepdims=True) / 2 for edge in (a, b, c)]
    dual = half[0] * np.cross(b, c) + half[1] * np.cross(c, a) + half[2] * np.cross(a, b)
    volume = (a * np.cross(b, c)).sum(axis=1, keepdims=True)
    return np.asarray(corners[:, 0] + dual / np.where(volume == 0, 1e-300, volume))


def empty_radii(of: Complex) -> FloatArray:
    """(F,) radii of the smallest balls through the corners of the triangles with no site inside.

    Their centres lie on the dual edges between the centres of the tetrahedra on both sides: at the
    circumcentre if the edge crosses the triangle's plane, else at the nearer end.
    """
    a, b, c = (of.sites[of.triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    lengths = np.prod([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    circumradius = lengths / np.maximum(2 * np.linalg.norm(normal, axis=1), 1e-300)
    front, back = (((of.centres[side] - a) * normal).sum(axis=1) for side in of.sides.T)
    crosses = np.sign(front) * np.sign(back) <= 0
    return np.asarray(np.where(crosses, circumradius, of.radii[of.sides].min(axis=1)))


def insideness(of: Complex) -> FloatArray:
    """(T,) how far inside the surface each tetrahedron is: below 0 outside, -1 at the box.

    It minimizes Σ bond (x_i − x_j)² over pairs of neighbours, plus Σ bond (x_i + x_j)² over the
    pairs of a point's poles. An open sheet has no inside, and the labels of its sides mean nothing.
    """
    size, points = len(of.tetrahedra), len(of.sites) - 8
    alike = np.stack([np.repeat(np.arange(size), 4), of.neighbours.reshape(-1)], axis=1)
    alike = alike[alike[:, 1] > alike[:, 0]]
    unlike = _poles(of)
    pairs = np.concatenate([alike, unlike])
    bond = np.exp(CONTRAST * np.concatenate([_meeting(of, alike), -_meeting(of, unlike)]))
    sign = np.repeat([1.0, -1.0], [len(alike), len(unlike)])
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    links = sparse.coo_matrix((np.tile(bond * sign, 2), (i, j)), (size, size)).tocsr()
    weight = np.bincount(i, np.tile(bond, 2), size)
    matrix = (sparse.diags_array(weight) - links).tocsr()
    at_box = (of.tetrahedra >= points).any(axis=1)
    free = ~at_box
    inside = np.full(size, -1.0)
    inside[free], _ = cg(
        matrix[free][:, free],
        np.asarray(matrix[free][:, at_box].sum(axis=1)).reshape(-1),
        rtol=SOLVED,
        maxiter=MOST_STEPS,
        M=sparse.diags_array(1 / weight[free]),
    )
    return inside


def _meeting(of: Complex, pairs: IntArray) -> FloatArray:
    """(n,) cosine of the angle at which two balls (n, 2) meet: 1 for one and the same, -1 apart."""
    distance = np.linalg.norm(of.centres[pairs[:, 0]] - of.centres[pairs[:, 1]], axis=1)
    one, two = of.radii[pairs].T
    return np.asarray(np.clip((one**2 + two**2 - distance**2) / (2 * one * two), -1, 1))


def _poles(of: Complex) -> IntArray:
    """(n, 2) the tetrahedra of both poles of each point that has two.

    The first has the largest ball through the point, the second the largest of those whose centres
    are on the other side.
    """
    points = len(of.sites) - 8
    order = np.argsort(of.radii, kind="stable")

    def largest(among: IntArray) -> IntArray:
        """(points,) of the corners `among`, the last one of each point as a tetrahedron, or -1."""
        found = np.full(len(of.sites), -1, dtype=np.int64)
        found[corner[among]] = among  # the last one stays
        return np.where(found < 0, -1, tetrahedron[found])[:points]

    tetrahedron, corner = np.repeat(order, 4), of.tetrahedra[order].reshape(-1)
    inner = np.flatnonzero(corner < points)
    first = largest(inner)
    outwards = of.centres[first] - of.sites[:points]
    at = of.centres[tetrahedron[inner]] - of.sites[corner[inner]]
    second = largest(inner[(at * outwards[corner[inner]]).sum(axis=1) < 0])
    return np.stack([first, second], axis=1)[second >= 0]
