"""The straightforward implementation is the same method: its gradients, on a few points."""

import numpy as np
import pytest

from benchmarks.checks import straightforward
from benchmarks.checks.straightforward import race, race_table, straightforward_maps
from parapoint import InputError


def test_it_trains() -> None:
    points = np.random.default_rng(0).normal(size=(120, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    maps = straightforward_maps(points, points[:7], 0)
    (first, before), *_, (last, after) = [next(maps) for _ in range(4)]
    assert 0 < first < last
    assert after.shape == (7, 2)
    assert np.isfinite(after).all()
    assert np.abs(after - before).max() > 1e-4
    again = straightforward_maps(points, points[:7], 0)
    np.testing.assert_array_equal(next(again)[1], before)


def test_the_table_has_a_row_for_each_thing_reached(monkeypatch) -> None:
    rows = [straightforward.Reached("computed", 100, 8.14, 0.02851)]
    monkeypatch.setattr(straightforward, "race", lambda *_: iter(rows))
    cells = [list(column.cells) for column in race_table("camelhead", 1.0).columns]
    assert cells == [["computed"], ["100"], ["8.1"], ["0.0285"]]


def test_a_race_needs_a_model_that_is_a_mesh(tmp_path) -> None:
    path = tmp_path / "cloud.xyz"
    np.savetxt(path, np.eye(3))
    with pytest.raises(InputError, match="is a cloud; the race needs a mesh"):
        next(race(str(path), 1.0))
