"""One file as another tool writes it, and what it means; see `benchmarks.checks.wild`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from parapoint.files.reading import read_surface
from parapoint.surfaces.surface import FloatArray, Mesh

POINTS = np.array([[1.5, 2.25, -3], [4, 5.5, 6], [7, 8.25, 9]])
"""(3, 3) the points that most files hold."""
SEED = 0
"""The seed of every random draw."""


class Case(NamedTuple):
    """One file.

    Attributes:
        name: its name.
        data: its bytes.
        is_right: tells whether what is read from a path is what the file means.
        may_refuse: whether the file may be refused as well.
    """

    name: str
    data: bytes
    is_right: Callable[[Path], bool]
    may_refuse: bool = False


def shows(expected: FloatArray) -> Callable[[Path], bool]:
    """Whether the points or vertices are these (N, 3)."""

    def is_right(path: Path) -> bool:
        surface = read_surface(path)
        found = surface.vertices if isinstance(surface, Mesh) else surface.points
        return found.shape == expected.shape and np.allclose(found, expected)

    return is_right


def cannot_be_told(path: Path) -> bool:
    """Read a file that must be refused."""
    read_surface(path)
    return False
