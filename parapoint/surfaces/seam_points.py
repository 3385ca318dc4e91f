"""Which points of a mapped cloud lie on a cutting seam: where neighbours are torn apart."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.surface import BoolArray, FloatArray

NEIGHBOURS = 3
"""K_cut of the paper: nearest points in space that are looked at from a point on a seam."""
THRESHOLD = 0.01
"""T_cut of the paper: distance in the plane, as a share of the side of the map's square bounding
box, beyond which one of these neighbours, or the other end of an edge, may lie across a seam."""
AROUND = 8
"""Nearest points that tell how much the map stretches near a point. A seam leaves at least about
half of them on its side, so their lower quartile is free of it."""
STRETCH = 5.0
"""How many times more than the pairs around either of them, or the edges around it, two neighbours
or an edge are stretched across a seam."""


def seam_points(points: FloatArray, uv: FloatArray, rule: str = "stretch") -> BoolArray:
    """(N,) whether each point lies on a cutting seam of its map.

    By the rule of the paper (eq. "find-cut") it does where one of its K_cut = 3 nearest points in
    space is farther from it in the plane than T_cut = 1 % of the side of the map's square bounding
    box. That is about the spacing of 10,000 points, the paper's setting; fewer are all farther from
    each other than that.

    By the rule "stretch" the pair must also be stretched 5 times as much as those around: by so
    much is it longer in the plane, over its length in space, than the lower quartile of the pairs
    of the 8 nearest points, at either of its ends. Both ends then lie on the seam. This holds at
    any density.

    Args:
        points: (N, 3) in space.
        uv: (N, 2) their images.
        rule: "stretch" or "paper".

    Raises:
        InputError: there is no such rule, or there are too few points.
    """
    if rule not in ("stretch", "paper"):
        raise InputError(f"rule must be stretch or paper, not {rule!r}")
    if len(points) <= NEIGHBOURS:
        raise InputError(f"seams need more than {NEIGHBOURS} points, not {len(points)}")
    count = min(AROUND, len(points) - 1)
    real, near = (of[:, 1:] for of in cKDTree(points).query(points, count + 1, workers=-1))
    length = np.linalg.norm(uv[near] - uv[:, None], axis=2)
    across = length > THRESHOLD * np.ptp(uv, axis=0).max()
    if rule == "stretch":
        stretch = length / np.maximum(real, np.finfo(np.float64).tiny)
        calm = np.quantile(stretch, 0.25, axis=1, method="lower")
        across &= stretch > STRETCH * np.minimum(calm[:, None], calm[near])
    across = across[:, :NEIGHBOURS]
    on_seam = across.any(axis=1)
    if rule == "stretch":
        on_seam[near[:, :NEIGHBOURS][across]] = True
    return np.asarray(on_seam)
