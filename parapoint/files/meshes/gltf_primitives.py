"""What a primitive of glTF draws: its triangles, in each of their modes, or its points."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from parapoint.files.content import strip_triangles
from parapoint.surfaces.surface import IntArray


def draws_triangles(primitive: dict[str, Any]) -> bool:
    """Whether a primitive is one of those whose triangles are read, in order."""
    return "POSITION" in primitive["attributes"] and primitive.get("mode", 4) in {4, 5, 6}


def draws_points(primitive: dict[str, Any]) -> bool:
    """Whether a primitive is one of those whose points are read."""
    return "POSITION" in primitive["attributes"] and primitive.get("mode", 4) == 0


def mode_triangles(mode: int, run: IntArray) -> IntArray:
    """(F, 3) triangles of a glTF primitive: mode 4 a list, 5 a strip, 6 a fan."""
    if mode == 4:
        return run.reshape(-1, 3)
    if mode == 5:
        return strip_triangles(np.array([len(run)]), run)
    return np.array([(run[0], *pair) for pair in pairwise(run[1:])], np.int64).reshape(-1, 3)
