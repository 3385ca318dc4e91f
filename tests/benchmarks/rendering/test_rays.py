"""Directions in which a surface is looked for: spread evenly over the sphere."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from benchmarks.rendering.rays import sphere_directions


@pytest.mark.parametrize("count", [64, 1000])
def test_directions_keep_their_distance_on_the_whole_sphere(count: int) -> None:
    """A turn by the golden section keeps 3.09 / sqrt(n); the most that n points can is 3.81."""
    directions = sphere_directions(count)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    distance = cKDTree(directions).query(directions, 2)[0][:, 1]
    assert distance.min() > 3.05 / np.sqrt(count)
    assert np.abs(directions.mean(axis=0)).max() < 0.01
