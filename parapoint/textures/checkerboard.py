"""A checkerboard, which shows at a glance how a map stretches its surface."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def checkerboard(squares: int = 32, pixels: int = 32) -> npt.NDArray[np.uint8]:
    """(H, W, 3) a texture of `squares` by `squares` fields, each `pixels` wide."""
    steps = np.arange(squares * pixels) // pixels
    dark = (steps[:, None] + steps[None]) % 2 == 0
    return np.where(dark[:, :, None], np.uint8(70), np.uint8(235)).repeat(3, axis=2)
