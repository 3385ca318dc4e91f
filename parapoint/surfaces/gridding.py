"""A surface as the grid of its plane: what a map without a triangulation can be drawn as."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import cKDTree

from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import FloatArray, Mesh

CELLS = 256
"""Cells of the grid along the longer side of the plane."""
REACH = 4.5
"""A corner of the grid is on the surface if the image of a known point is within this many
spacings. A spacing is the median distance from an image to the nearest other one; between random
points the widest gaps reach to 3.5 spacings."""
LONGEST = 8.0
"""Longest edge of a cell on the surface, in medians of all of them; a longer one tears it."""


def gridded(known: FloatArray, lift: Callable[[FloatArray], FloatArray]) -> Charted:
    """The grid of the plane near known images (N, 2), lifted to the surface.

    Args:
        known: images of points of the surface, which tell where the plane is covered.
        lift: (n, 2) points of the plane → (n, 3) points of the surface.
    """
    low, step = known.min(axis=0), np.ptp(known, axis=0).max() / CELLS
    counts = np.floor(np.ptp(known, axis=0) / step).astype(np.int64) + 2
    row = np.arange(counts.prod()).reshape(counts)
    uv = low + step * np.stack(np.unravel_index(row.reshape(-1), counts), axis=1)
    tree = cKDTree(known)
    spacing = np.median(tree.query(known, 2)[0][:, 1])
    near = tree.query(uv, distance_upper_bound=max(REACH * spacing, 2 * step))[0]
    covered = np.isfinite(near).reshape(counts)
    cell = covered[:-1, :-1] & covered[1:, :-1] & covered[1:, 1:] & covered[:-1, 1:]
    a, b, c, d = row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]
    faces = np.concatenate([np.stack(t, axis=-1)[cell] for t in ((a, b, c), (a, c, d))])
    used = np.unique(faces)
    points = np.zeros((len(uv), 3))
    points[used] = lift(uv[used])
    corners = points[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    faces = faces[longest <= LONGEST * np.median(longest)]
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3)
    return Charted(Mesh(points[used], faces), Parameterization(uv[used], faces))
