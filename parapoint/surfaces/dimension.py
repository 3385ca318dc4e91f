"""Whether the points of a cloud lie on a surface at all, or along a curve, or fill space.

In a ball around a point of a d-dimensional set, N grows as the radius to the power of d (the
correlation dimension of Grassberger and Procaccia 1983, "Measuring the strangeness of strange
attractors"). Noise makes a surface look solid at the scale of its thickness, and solids look like
nothing else at any; so it is measured at many scales.
"""

from __future__ import annotations

import logging

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

logger = logging.getLogger("parapoint")

FEWEST = 100
"""Clouds of fewer points are not judged."""
SAMPLE = 100_000
"""Most points among which neighbours are counted."""
LOOKED_AT = 300
"""Points around which they are counted."""
SMALLEST, LARGEST, LARGEST_OF_SOLID = 8, 4096, 1024
"""Neighbours at the first scale, at the last one, and at the last one that is held against a solid,
most of whose larger balls reach its rim. A scale compares the distance to a number of neighbours
with that to four times as many; the next scale begins at twice the number."""
CURVE = 1.3
"""Dimension that a curve is below at all scales; no model of the benchmark is."""
SOLID = 2.45
"""Dimension that a solid is above at all its scales: balls, cubes and grids of 150 to 20,000 points
are above 2.49, and the benchmark's models with noise of 2 % of their diagonal fall below 2.44."""


def checked_dimension(surface: Surface) -> dict[str, object]:
    """Say what is no surface; the fact that a cloud fills space, if it does.

    Raises:
        InputError: the points of a cloud lie along a curve.
    """
    if isinstance(surface, Mesh):
        return {}
    found = dimensions(surface.points)
    if len(found) and found.max() < CURVE:
        raise InputError("the points lie along a curve; a fit needs points of a surface")
    if len(found) and found[: _doublings(LARGEST_OF_SOLID) - 1].min() > SOLID:
        logger.warning(
            "the points fill space, as those of a solid do, and show no surface: "
            "the map is of some surface through them"
        )
        return {"fills_space": True}
    return {}


def dimensions(points: FloatArray) -> FloatArray:
    """(s,) the dimension of (N, 3) points at s scales, smallest first; (0,) of few points."""
    rng = np.random.default_rng(0)
    if len(points) > SAMPLE:
        points = points[rng.choice(len(points), SAMPLE, replace=False)]
    points = np.unique(points, axis=0)
    if len(points) < FEWEST:
        return np.zeros(0)
    places = Frame.of(points).inside(points)
    around = places[rng.permutation(len(places))[:LOOKED_AT]]
    doublings = max(2, _doublings(min(LARGEST, len(places) // 4)))
    counts = SMALLEST * 2 ** np.arange(doublings + 1)
    # The nearest neighbour of a point is the point itself.
    radius = cKDTree(places).query(around, (counts + 1).tolist())[0]
    growth = np.log(radius[:, 2:] / np.maximum(radius[:, :-2], 1e-300)).mean(axis=0)
    return np.asarray(np.log(4) / np.maximum(growth, 1e-9))


def _doublings(largest: int) -> int:
    """How often SMALLEST neighbours can be doubled up to `largest`."""
    return int(np.log2(max(largest, SMALLEST) / SMALLEST))
