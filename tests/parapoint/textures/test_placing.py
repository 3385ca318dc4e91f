import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint.textures.placing import BORDER, Placing

RNG = np.random.default_rng(0)


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 4.0])
def test_a_turned_square_fills_the_square_again(angle) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    uv = (100 * RNG.random((500, 2))) @ turn.T + [7, -3]
    placing = Placing.smallest(
        np.vstack([uv, [[0, 0], [100, 0], [100, 100], [0, 100]] @ turn.T + [7, -3]])
    )
    placed = placing(uv)
    assert placed.min() > BORDER - 0.01
    assert placed.max() < 1 - BORDER + 0.01
    assert placing.scale == pytest.approx((1 - 2 * BORDER) / 100, rel=5e-3)


def test_distances_keep_their_ratio_and_the_side_its_hand() -> None:
    uv = RNG.random((50, 2)) * [3, 1]
    placing = Placing.smallest(uv)
    before, after = np.diff(uv, axis=0), np.diff(placing(uv), axis=0)
    assert_allclose(np.linalg.norm(after, axis=1), placing.scale * np.linalg.norm(before, axis=1))
    assert np.linalg.det(placing.turn) == pytest.approx(1)


def test_a_map_lies_in_the_middle_of_the_square() -> None:
    """A rectangle of 10 by 7 fills the square along one side; the rest is free on both sides."""
    rectangle = np.array([[0.0, 0], [10, 0], [10, 7], [0, 7]])
    placed = Placing.smallest(rectangle, border=0.1)(rectangle)
    assert_allclose(placed.min(axis=0), [0.1, 0.22])
    assert_allclose(placed.max(axis=0), [0.9, 0.78])


def test_points_on_a_line_find_a_place() -> None:
    line = np.column_stack([np.arange(5.0), np.zeros(5)])
    placed = Placing.smallest(line)(line)
    assert np.isfinite(placed).all()
    assert 0 <= placed.min() <= placed.max() <= 1
