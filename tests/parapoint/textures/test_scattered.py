import numpy as np
from numpy.testing import assert_allclose

from parapoint.textures import scattered
from parapoint.textures.scattered import Scattered

RNG = np.random.default_rng(0)


def test_affine_functions_are_found_exactly_in_the_plane() -> None:
    points = np.column_stack([RNG.random((500, 2)), np.zeros(500)])
    places = np.column_stack([0.1 + 0.8 * RNG.random((200, 2)), np.zeros(200)])
    function = np.array([[1.0, -2.0], [3.0, 0.5], [0.0, 0.0]])
    found = Scattered(points, points @ function + 7)(places)
    # The ridge takes 0.1 % of the variance; the mean offset of the neighbours is some 0.01.
    assert_allclose(found, places @ function + 7, atol=2e-3)


def test_at_a_point_its_own_value_counts_most() -> None:
    points = RNG.random((300, 3))
    values = RNG.random((300, 1))
    found = Scattered(points, values)(points)
    assert np.corrcoef(found[:, 0], values[:, 0])[0, 1] > 0.8


def test_values_are_neither_less_nor_more_than_those_around() -> None:
    points = np.column_stack([RNG.random((100, 2)), np.zeros(100)])
    values = (points[:, :1] > 0.5).astype(np.uint8)
    found = Scattered(points, values)(3 * RNG.random((500, 3)) - 1)
    assert found.min() == 0
    assert found.max() == 1


def test_batches_and_few_points_do_not_matter(monkeypatch) -> None:
    points, places = RNG.random((3, 3)), RNG.random((10, 3))
    whole = Scattered(points, points)(places)
    monkeypatch.setattr(scattered, "BATCH", 3)
    assert_allclose(Scattered(points, points)(places), whole)
    alone = Scattered(points[:1], points[:1])(places)
    assert_allclose(alone, np.repeat(points[:1], 10, axis=0))
    twice = Scattered(np.repeat(points[:1], 20, axis=0), np.ones((20, 1)))(points[:1])
    assert_allclose(twice, 1)
