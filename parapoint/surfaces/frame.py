"""The frame in which a surface is mapped: centred and scaled, so place and unit do not count."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np

from parapoint.errors import InputError
from parapoint.surfaces.surface import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Frame:
    """A similarity of space: a point p of the surface is (p − centre) / scale inside the frame.

    Attributes:
        centre: (3,) the point that becomes the origin.
        scale: the length that becomes 1, in the surface's unit.

    Raises:
        InputError: the centre is not three finite numbers, or the scale is not positive and finite.
    """

    centre: FloatArray
    scale: float

    def __post_init__(self) -> None:
        centre = np.asarray(self.centre, dtype=np.float64)
        if centre.shape != (3,) or not np.isfinite(centre).all():
            raise InputError("the centre of a frame must be three finite numbers")
        if not 0 < self.scale < np.inf:
            raise InputError(f"the scale of a frame must be a positive number, not {self.scale}")
        object.__setattr__(self, "centre", centre)

    @classmethod
    def of(cls, points: FloatArray) -> Self:
        """The frame of (N, 3) points: their bounding box around the origin, largest norm 1.

        Raises:
            InputError: the points are all one, or lie farther apart than a float64 can say.
        """
        low, high = points.min(axis=0), points.max(axis=0)
        with np.errstate(over="ignore"):
            centre = low + (high - low) / 2
            offsets = points - centre
        unit = power_of_two(offsets)  # so that no square is too large or too small for a float64
        return cls(centre, float(np.linalg.norm(offsets / unit, axis=1).max() * unit))

    def inside(self, points: FloatArray) -> FloatArray:
        """(N, 3) points of the surface → the same points in the frame."""
        return np.asarray((points - self.centre) / self.scale)

    def outside(self, points: FloatArray) -> FloatArray:
        """(N, 3) points in the frame → the same points in the surface's unit and place."""
        return np.asarray(points * self.scale + self.centre)


def power_of_two(values: FloatArray) -> float:
    """The power of two next below the largest magnitude: a division by it rounds nothing.

    Raises:
        InputError: all values are 0, or one is not finite.
    """
    size = float(np.abs(values).max())
    if not 0 < size < np.inf:
        raise InputError(
            "all points are one and the same"
            if size == 0
            else "the points lie farther apart than a number can say; scale them down"
        )
    return math.ldexp(0.5, math.frexp(size)[1])


IDENTITY = Frame(np.zeros(3), 1.0)
"""The frame that leaves points as they are."""

UNIT = 100.0
"""Radius of the meshes that libraries are given. Some of them work in single precision, and all
have lengths built in below which they see no triangle."""


def in_unit(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Vertices (V, 3) around the origin, UNIT from it at most: what tools of float32 are given.

    Those of no face (F, 3), which may lie anywhere, are at the origin.
    """
    used = np.unique(faces)
    inside = np.zeros_like(vertices)
    inside[used] = UNIT * Frame.of(vertices[used]).inside(vertices[used])
    return inside
