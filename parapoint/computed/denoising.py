"""A noisy cloud moved to the surface that it scatters about; a clean one as it is.

A quadratic height over the plane of its neighbours is fitted to the cloud at each point, which goes
to the foot on it, twice (moving least squares, as in Alexa et al. 2003, "Computing and rendering
point set surfaces"; the fit is the jet of Cazals and Pouget 2005). The first residuals tell whether
the cloud is noisy: on smooth surfaces without noise they are a small part of the spacing, whatever
the curvature at some points.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from parapoint.surfaces.surface import FloatArray, IntArray

TELLING, SMOOTHING = 16, 48
"""Points in a fit, the one in the middle among them: to find noise, and to take it away."""
NOISE = 0.2
"""Median residual of a noisy cloud, in spacings: it is 0.05 at most on clean models and scans and
0.3 at a noise of 0.5 % of the diagonal."""
WIDTH = 0.5
"""Standard deviation of the weights, in distances to the farthest neighbour."""
PASSES = 2
"""How often each point is moved."""
FEWEST = 200
"""A cloud of fewer points is not moved."""


def denoised(points: FloatArray) -> FloatArray:
    """(N, 3) distinct points (N, 3) without their noise, in order; the same array where none is."""
    if len(points) < FEWEST or noise(points) < NOISE:
        return points
    for _ in range(PASSES):
        distance, near = cKDTree(points).query(points, SMOOTHING)
        weight = np.exp(-((distance / (WIDTH * distance[:, -1:])) ** 2) / 2)
        points, _ = _fitted(points, near, weight)
    return points


def noise(points: FloatArray) -> float:
    """The median residual of a quadratic fit to points (N, 3), over the median spacing."""
    distance, near = cKDTree(points).query(points, TELLING)
    _, residual = _fitted(points, near, np.ones_like(distance))
    spacing = distance[:, 1:7].mean(axis=1)
    return float(np.median(residual) / np.median(spacing))


def _fitted(
    points: FloatArray, near: IntArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(N, 3) the points moved to quadratic heights over their neighbours, (N,) rms residuals.

    Args:
        points: (N, 3) points.
        near: (N, K) rows of their neighbours.
        weight: (N, K) of these.
    """
    weight = weight / weight.sum(axis=1, keepdims=True)
    offsets = points[near] - points[:, None]
    mean = (weight[:, :, None] * offsets).sum(axis=1)
    offsets -= mean[:, None]
    _, axes = np.linalg.eigh(np.einsum("nk,nki,nkj->nij", weight, offsets, offsets))
    height, *plane = np.moveaxis(offsets @ axes, 2, 0)  # the normal has the least eigenvalue
    here = -np.einsum("ni,nij->nj", mean, axes)
    size = np.sqrt(np.einsum("nk,nk->n", weight, plane[0] ** 2 + plane[1] ** 2))[:, None]
    terms = _quadratic(plane[0] / size, plane[1] / size)
    normal = np.einsum("nk,nki,nkj->nij", weight, terms, terms) + 1e-9 * np.eye(6)
    right = np.einsum("nk,nki,nk->ni", weight, terms, height)
    shape = np.linalg.solve(normal, right[:, :, None])
    residual = height - (terms @ shape)[:, :, 0]
    foot = here.copy()
    foot[:, 0] = (_quadratic(here[:, 1:2] / size, here[:, 2:] / size) @ shape)[:, 0, 0]
    moved = points + mean + np.einsum("nj,nij->ni", foot, axes)
    return moved, np.sqrt(np.einsum("nk,nk->n", weight, residual**2))


def _quadratic(x: FloatArray, y: FloatArray) -> FloatArray:
    """(N, K, 6) the monomials of x, y (N, K) up to degree 2."""
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
