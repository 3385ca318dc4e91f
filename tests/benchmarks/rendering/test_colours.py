"""From samples of linear light to pixels in sRGB."""

import numpy as np
import pytest

from benchmarks.rendering.colours import averaged, linear


def pixel(samples: list[float]) -> list[int]:
    """A pixel of four samples, the first of which are grey and the others clear."""
    grey = np.repeat(np.array(samples, dtype=np.float32)[:, None], 3, axis=1)
    return averaged((1, 1), 2, np.arange(len(samples)), grey)[0, 0].tolist()


@pytest.mark.parametrize("level", [0, 1, 6, 10, 11, 60, 128, 254, 255])
def test_light_becomes_srgb_and_back(level: int) -> None:
    assert pixel([float(linear(level / 255))] * 4) == [level, level, level, 255]


def test_a_pixel_is_the_mean_light_of_its_samples_and_as_clear_as_its_share() -> None:
    """A mean of linear 0.5 is sRGB 188; clear samples make it clear, and not dark."""
    assert pixel([0.25, 0.75, 0.25, 0.75]) == [188, 188, 188, 255]
    assert pixel([0.25, 0.75]) == [188, 188, 188, 128]
    assert pixel([2.0]) == [255, 255, 255, 64]
    assert pixel([]) == [0, 0, 0, 0]
