"""Geometric stretch of a map to the plane, and its descent without flips."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from baselines.disks.mean_value import balanced, mean_value_weights
from parapoint.planar.domains import Domain, frames, scaled, singular_values
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.surface import FloatArray, Mesh

MOST_STEPS = 30
"""Steps of the stretch's descent at most."""


def stretches(disk: Domain, uv: FloatArray) -> FloatArray:
    """(F,) squared stretch (1/s1² + 1/s2²) / 2 of each triangle, in a plane of the same area."""
    s1, s2 = singular_values(frames(disk.vertices, disk.faces), scaled(disk, uv), disk.faces)
    return np.asarray((s1**-2 + s2**-2) / 2)


def stretch(disk: Domain, uv: FloatArray) -> float:
    """The mean squared stretch over the area; infinite where a triangle is flipped."""
    if not (signed_areas(uv, disk.faces) > 0).all():
        return float("inf")
    area = Mesh(disk.vertices, disk.faces).face_areas
    return float(area @ stretches(disk, uv) / area.sum())


def relaxed(disk: Domain, uv: FloatArray) -> Iterator[FloatArray]:
    """The maps (V, 2) after `uv` as the stretch falls, the boundary held.

    A neighbour whose triangles are stretched in space by q pulls with its weight over q: what is
    too small in the plane grows (Yoshizawa et al. 2004).
    """
    weights, area = mean_value_weights(disk), Mesh(disk.vertices, disk.faces).face_areas
    around = np.bincount(disk.faces.reshape(-1), np.repeat(area, 3), len(uv))
    for _ in range(MOST_STEPS):
        shares = np.repeat(area * stretches(disk, uv), 3)
        of_vertex = np.sqrt(np.bincount(disk.faces.reshape(-1), shares, len(uv)) / around)
        weights = (weights @ sparse.diags_array(1 / of_vertex)).tocsr()
        moved = balanced(weights, disk.loop, uv[disk.loop])
        if not stretch(disk, moved) < stretch(disk, uv):
            return
        uv = moved
        yield uv
