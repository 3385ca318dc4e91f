"""Where a map lies in the unit square of its texture."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import FloatArray

BORDER = 1 / 256
"""Width that stays free around the map, in sides of the square: 8 texels of 2048."""
TURNS = 360
"""Directions that are tried, evenly spread over a right angle."""


class Placing(NamedTuple):
    """A similarity of the plane: a point p of the map lies at `turn` @ p * scale + shift.

    Attributes:
        turn: (2, 2) a rotation.
        scale: sides of the square a unit of the map.
        shift: (2,).
    """

    turn: FloatArray
    scale: float
    shift: FloatArray

    @classmethod
    def smallest(cls, uv: FloatArray, border: float = BORDER) -> Self:
        """The map (T, 2) turned to its smallest square, which fills the unit square."""
        try:
            hull = uv[ConvexHull(uv).vertices]
        except (QhullError, ValueError):
            hull = uv
        angles = np.linspace(0, np.pi / 2, TURNS, endpoint=False)
        turns = np.stack(
            [[np.cos(angles), -np.sin(angles)], [np.sin(angles), np.cos(angles)]]
        ).transpose(2, 0, 1)
        placed = hull @ turns.transpose(0, 2, 1)
        sides = np.ptp(placed, axis=1).max(axis=1)
        best = int(sides.argmin())
        low, high = placed[best].min(axis=0), placed[best].max(axis=0)
        scale = (1 - 2 * border) / max(float(sides[best]), 1e-300)
        return cls(turns[best], scale, 0.5 - scale * (low + high) / 2)

    def __call__(self, uv: FloatArray) -> FloatArray:
        """(N, 2) points of the map → (N, 2) points of the unit square."""
        return np.asarray(self.scale * (uv @ self.turn.T) + self.shift)

    def of(self, charted: Charted) -> Charted:
        """The mesh with its map in the unit square."""
        return Charted(charted.mesh, Parameterization(self(charted.map.uv), charted.map.corners))
