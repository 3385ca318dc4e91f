"""A checkerboard, which shows at a glance how a map stretches its surface."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SQUARES = 32
"""Fields along a side of the checkerboard."""


def checkerboard(size: int = 1024) -> npt.NDArray[np.uint8]:
    """(size, size, 3) a texture of SQUARES by SQUARES fields."""
    steps = np.arange(size) * SQUARES // size
    dark = (steps[:, None] + steps[None]) % 2 == 0
    return np.where(dark[:, :, None], np.uint8(70), np.uint8(235)).repeat(3, axis=2)
