import json
import logging
import math
import subprocess
import sys

import numpy as np
import pytest

from parapoint import ComputedMap, InputError, PointCloud, clock
from parapoint.computed import computed_map
from parapoint.computed.flattening import FlatMap, flat_map
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.estimator import load
from parapoint.fitting import Session


def paraboloid(count: int = 400) -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * (xy**2).sum(axis=1)]) * 7 + [10.0, -5.0, 2.0]


@pytest.fixture(scope="module")
def computed() -> ComputedMap:
    return ComputedMap().fit(paraboloid())


def test_the_inverse_undoes_the_map(computed: ComputedMap) -> None:
    points = paraboloid()
    assert computed.report_["anchors"] == 400
    assert computed.report_["found"]["boundary_loops"] == 1
    uv = computed.transform(points)
    np.testing.assert_allclose(computed.inverse_transform(uv), points, atol=1e-4)
    # Points between the anchors come back near where they were: 7 is the radius.
    inner = np.abs(paraboloid(3000)[:, :2] - [10, -5]).max(axis=1) < 6
    dense = paraboloid(3000)[inner]
    back = computed.inverse_transform(computed.transform(dense))
    assert np.linalg.norm(back - dense, axis=1).max() < 0.02 * computed.frame_.scale


def test_dense_points_of_a_plane_are_mapped_isometrically() -> None:
    plane = paraboloid() * [1, 1, 0]
    model = ComputedMap().fit(plane)
    dense = paraboloid(900)[400:] * [1, 1, 0]
    uv = model.transform(dense)
    apart = np.linalg.norm(dense[:, None] - dense, axis=2)
    np.testing.assert_allclose(np.linalg.norm(uv[:, None] - uv, axis=2), apart, atol=1e-4)


def test_a_saved_model_maps_as_before(computed: ComputedMap, tmp_path) -> None:
    computed.save(tmp_path)
    loaded = ComputedMap.load(tmp_path)
    dense = paraboloid(700)
    assert np.array_equal(loaded.transform(dense), computed.transform(dense))
    uv = computed.transform(dense)
    assert np.array_equal(loaded.inverse_transform(uv), computed.inverse_transform(uv))
    assert loaded.report_ == json.loads(json.dumps(computed.report_))


def test_a_map_that_is_no_larger_than_a_point_somewhere_keeps_no_angle_there() -> None:
    flat = flat_map(paraboloid() / 7, math.inf, "conformal")
    whole = computed_map._conformality(flat)
    half = flat._replace(jacobians=flat.jacobians * (np.arange(400) % 2)[:, None, None])
    assert 0.9 < whole <= 1
    assert computed_map._conformality(half) == pytest.approx(whole / 2, abs=0.05)


def test_a_cloud_that_shows_no_surface_says_so() -> None:
    parts = [paraboloid(150) + np.array([100.0 * k, 0, 0]) for k in range(3)]
    with pytest.raises(ReconstructionError, match="the largest component holds 150 of 450"):
        ComputedMap().fit(np.concatenate(parts))


def test_no_network_takes_part() -> None:
    code = (
        "import sys; import numpy as np; from parapoint import ComputedMap; "
        "x = np.random.default_rng(0).uniform(-1, 1, (200, 2)); "
        "ComputedMap().fit(np.column_stack([x, x[:, 0] ** 2])).transform(np.zeros((1, 3))); "
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"points": 50}, "points must be a whole number of at least 100 .*, not 50"),
        ({"points": 200.5}, "points must be a whole number"),
        ({"time_budget": 0}, "time_budget must be a number above 0"),
        ({"time_budget": math.inf}, "time_budget must be"),
        ({"components": "some"}, "components must be one of together, each, largest"),
        ({"distortion": "none"}, "distortion must be one of conformal, balanced, isometric"),
        ({"seed": -1}, "seed must be a whole number of at least 0"),
    ],
)
def test_a_wrong_parameter_is_one_line(parameters, message) -> None:
    with pytest.raises(InputError, match=message):
        ComputedMap(**parameters).fit(paraboloid())


def test_each_component_gets_a_map_and_they_stand_apart(tmp_path) -> None:
    near, far = paraboloid(300), paraboloid(200) + np.array([1e3, 0, 0])
    model = ComputedMap(components="each").fit(np.concatenate([near, far]))
    assert model.report_["components"] == 2
    left, right = model.transform(near), model.transform(far)
    gaps = np.maximum(right.min(axis=0) - left.max(axis=0), left.min(axis=0) - right.max(axis=0))
    assert gaps.max() > 0, "their boxes overlap"
    alone = ComputedMap().fit(near)
    np.testing.assert_allclose(
        left - left.min(axis=0), alone.transform(near) - alone.transform(near).min(axis=0)
    )
    np.testing.assert_allclose(model.inverse_transform(right), far, atol=1e-9)
    model.save(tmp_path)
    assert np.array_equal(load(tmp_path).transform(far), right)


def test_a_part_of_a_surface_has_its_share_of_the_points() -> None:
    part = PointCloud(paraboloid())
    assert ComputedMap(points=600).fit_part(part, 0.5, Session()).report["points"] == 300


def test_points_off_the_surface_are_counted_and_mapped_nowhere(caplog) -> None:
    points = np.concatenate([paraboloid(), paraboloid(100) + np.array([500.0, 0, 0])])
    with caplog.at_level(logging.WARNING, logger="parapoint"):
        model = ComputedMap().fit(points)
    assert "100 of 500 points are not on the surface that was found" in caplog.text
    is_mapped = np.isfinite(model.transform(points)).all(axis=1)
    np.testing.assert_array_equal(is_mapped, np.arange(500) < 400)
    each = ComputedMap(components="each").fit(points)
    assert np.isfinite(each.transform(points)).all()


def test_points_that_nearly_coincide_count_once() -> None:
    points = paraboloid()
    noise = 1e-9 * np.random.default_rng(1).normal(size=points.shape)
    model = ComputedMap().fit(np.concatenate([points, points + noise]))
    assert 400 <= model.report_["anchors"] <= 402  # a pair may lie on two sides of a rounding


class Clock:
    """Runs only while maps are computed: `pace` seconds a point, `slow` after the first map."""

    def __init__(self, monkeypatch, pace: float, slow: float | None = None) -> None:
        self.now, self.counts, self.change = 100.0, [], lambda flat: flat

        def timed(points: np.ndarray, *_: object) -> FlatMap:
            self.counts.append(len(points))
            is_first = len(self.counts) == 1
            self.now += len(points) * (pace if is_first or slow is None else slow)
            flat = flat_map(points)
            return flat if is_first else self.change(flat)

        monkeypatch.setattr(clock, "worked", lambda: self.now)
        monkeypatch.setattr(computed_map, "flat_map", timed)


def test_a_time_budget_allows_as_many_computed_points_as_the_first_map_shows(monkeypatch) -> None:
    timed = Clock(monkeypatch, pace=0.004)
    model = ComputedMap(time_budget=4.0).fit(paraboloid(700))
    # 200 points take 0.8 s; the descents end after 3.2 s, and 55 % of what is left are planned.
    assert timed.counts == [200, 330]
    assert model.report_["anchors"] == model.report_["points"] == 330
    assert not model.report_["cut_short"]


def test_on_a_busy_machine_the_first_map_stays(monkeypatch) -> None:
    timed = Clock(monkeypatch, pace=0.01)
    model = ComputedMap(time_budget=4.0).fit(paraboloid(700))
    assert timed.counts == [200]
    assert len(model.points_) == model.report_["anchors"] == 200


def sheared(flat: FlatMap) -> FlatMap:
    shear = np.diag([4.0, 1.0])
    return flat._replace(uv=flat.uv @ shear, jacobians=shear @ flat.jacobians)


@pytest.mark.parametrize(("change", "points"), [(lambda flat: flat, 330), (sheared, 200)])
def test_a_map_that_is_cut_short_stays_where_it_is_the_better(
    change, points: int, monkeypatch, caplog
) -> None:
    timed = Clock(monkeypatch, pace=0.004, slow=0.1)
    timed.change = change
    model = ComputedMap(time_budget=4.0).fit(paraboloid(700) * [1, 1, 0])
    assert timed.counts == [200, 330]
    assert model.report_["points"] == model.report_["anchors"] == points
    assert model.report_["cut_short"]
    assert f"the time was up before the map was at its best; it is of {points}" in caplog.text


def test_a_second_map_that_fails_leaves_the_first(monkeypatch, caplog) -> None:
    def failed(_: FlatMap) -> FlatMap:
        raise ReconstructionError("no surface")

    Clock(monkeypatch, pace=0.004).change = failed
    model = ComputedMap(time_budget=4.0).fit(paraboloid(700))
    assert model.report_["points"] == model.report_["anchors"] == 200
    assert "no map of 330 points could be computed: no surface" in caplog.text


def test_a_budget_that_is_spent_at_once_still_gives_a_map() -> None:
    model = ComputedMap(time_budget=1e-3).fit(paraboloid())
    assert model.report_["cut_short"]
    uv = model.transform(paraboloid())
    assert np.linalg.matrix_rank(uv - uv.mean(axis=0)) == 2
