"""Colours and pixels: linear light in, an image in sRGB out.

The same input gives the same bytes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from parapoint.surfaces.surface import IntArray

Image = npt.NDArray[np.uint8]
"""(height, width, 4) RGBA in sRGB, alpha not premultiplied."""

Floats = npt.NDArray[np.float32]


def linear(srgb: npt.ArrayLike) -> Floats:
    """Linear light, float32, of sRGB values in [0, 1]: what pictures are computed in."""
    values = np.asarray(srgb, dtype=np.float64)
    found = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)
    return np.asarray(found, dtype=np.float32)


LIGHT_TONE, DARK_TONE = linear([0.93, 0.92, 0.89]), linear([0.16, 0.38, 0.64])
"""The two tones of the checkerboard."""

SEAM_GREEN, FLIP_ORANGE = linear([0.0, 0.72, 0.22]), linear([0.84, 0.37, 0.0])

CLAY, INK = linear([0.80, 0.79, 0.77]), linear([0.10, 0.10, 0.12])


def averaged(shape: tuple[int, int], samples: int, sample: IntArray, colours: Floats) -> Image:
    """The picture of (height, width) pixels whose samples have linear `colours` (S, 3).

    `sample` (S,) is the place of each in the grid of `samples` by `samples` a pixel; what it does
    not name is clear.
    """
    height, width = shape
    row, column = np.divmod(sample, width * samples)
    pixel = row // samples * width + column // samples
    shown = np.zeros(height * width, dtype=np.bool_)
    shown[pixel] = True
    place = np.cumsum(shown) - 1
    grid = np.zeros((samples**2, int(shown.sum()), 4), dtype=np.float32)
    at = (row % samples * samples + column % samples) * grid.shape[1] + place[pixel]
    flat = grid.reshape(-1, 4)
    flat[at, :3] = np.minimum(colours, 1)
    flat[at, 3] = 1
    means = np.zeros(grid.shape[1:], dtype=np.float32)
    for layer in grid:
        means += layer
    means /= samples**2
    cover = means[:, 3:]
    image = np.zeros((height * width, 4), dtype=np.uint8)
    means[:, :3] /= cover
    image[shown] = np.round(255 * np.concatenate([_srgb(means[:, :3]), cover], axis=1))
    return image.reshape(height, width, 4)


def _srgb(linear: Floats) -> Floats:
    """SRGB values of linear light in [0, 1]."""
    return np.asarray(
        np.where(
            linear <= 0.0031308,
            linear * 12.92,
            1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055,
        )
    )
