import dataclasses
import json
import logging
import math

import numpy as np
import pytest
import torch

from parapoint import InputError, ParaPoint, PointCloud
from parapoint.fitting import Fitted
from parapoint.learned import presets
from parapoint.learned.networks import Networks
from parapoint.learned.presets import PRESETS
from parapoint.surfaces.strays import fitted_rows
from parapoint.testing import irregular_disk

TINY = {"preset": "paper", "points": 150, "subset": 100, "iterations": 6, "device": "cpu"}


def paraboloid(count: int = 400) -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * (xy**2).sum(axis=1)]) * 7 + [10.0, -5.0, 2.0]


@pytest.fixture(scope="module")
def fitted() -> ParaPoint:
    return ParaPoint(**TINY).fit(paraboloid())


def test_every_preset_runs() -> None:
    for name in PRESETS:
        model = ParaPoint(**{**TINY, "preset": name, "iterations": 2}).fit(paraboloid())
        assert np.isfinite(model.transform(paraboloid())).all()


def test_parameters_follow_scikit_learn() -> None:
    model = ParaPoint(points=500)
    assert ParaPoint(**model.get_params()) == model
    assert model.set_params(seed=3, branches="3d") is model
    assert (model.seed, model.branches) == (3, "3d")
    with pytest.raises(InputError, match="no parameter 'speed'"):
        model.set_params(speed=1)
    assert not [name for name in vars(model) if name.endswith("_")]


def test_none_takes_the_preset_s_value() -> None:
    assert ParaPoint(preset="paper").numbers() == PRESETS["paper"]
    changed = ParaPoint(preset="paper", distortion="isometric", distortion_weight=1e-4).numbers()
    assert (changed.distortion, changed.distortion_weight) == ("isometric", 1e-4)
    left_out = ParaPoint(preset="paper", unwrap_weight=0, cycle_weight=0, anti_flip_weight=0)
    kept = {name: weight for name, weight in left_out.numbers().facts().items() if "weight" in name}
    assert {name for name, weight in kept.items() if weight} == {"wrap_weight", "distortion_weight"}


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"preset": "best"}, "no preset 'best'; there are: paper, learned"),
        ({"preset": "computed"}, "no preset 'computed': it is a method of its own: ComputedMap"),
        ({"preset": "fast"}, "no preset 'fast': the computed map is a method of its own"),
        ({"preset": "smooth"}, "no preset 'smooth': its name is \"learned\""),
        ({"points": 50}, "points must be a whole number of at least 100 .*, not 50"),
        ({"iterations": 0}, "iterations must be"),
        ({"iterations": 2.5}, "iterations must be"),
        ({"time_budget": -1.0}, "time_budget must be"),
        ({"time_budget": 0}, "time_budget must be a number above 0"),
        ({"time_budget": 2e9}, "time_budget must be .* at most 1e.09"),
        ({"time_budget": math.nan}, "time_budget must be"),
        ({"distortion_weight": -0.1}, "distortion_weight must be a number of at least 0"),
        ({"distortion": "authalic"}, "distortion must be one of conformal, isometric"),
        ({"branches": "4d"}, "branches must be one of both, 3d, 2d"),
        ({"all_from": 1.5}, "all_from must be a number of at least 0 and at most 1"),
        ({"seed": -1}, "seed must be"),
        ({"device": "abacus"}, "device must be auto, cpu or cuda"),
        ({"distortion": np.zeros(2)}, "distortion must be one of"),
        ({"components": ["largest"]}, "components must be one of"),
        ({"points": 10**5000}, "points must be a whole number"),
        ({"iterations": 10**23}, "iterations must be a whole number"),
        ({"threads": 10**6}, "threads must be a whole number"),
        ({"distortion_weight": 1e308}, "distortion_weight must be a number"),
    ],
)
def test_a_wrong_parameter_is_one_line(parameters: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        ParaPoint(**parameters).fit(paraboloid())
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.repeat(paraboloid(60), 5, axis=0), "60 distinct points; a fit needs at least 100"),
        (np.outer(np.linspace(0, 1, 500), [1.0, 2.0, 3.0]), "along a curve"),
        (np.full((500, 3), math.nan), "at least one point"),
        (np.zeros((500, 2)), r"shape \(n, 3\)"),
        ("x", "points must be numbers"),
        ([[1, 2, 3], [4, 5]], "points must be numbers"),
    ],
)
def test_points_that_are_no_surface_are_one_line(points: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ParaPoint(**TINY).fit(points)


def test_planar_points_can_be_fitted() -> None:
    flat = paraboloid() * [1, 1, 0]
    uv = ParaPoint(**TINY).fit(flat).transform(flat)
    assert np.linalg.matrix_rank(uv - uv.mean(axis=0)) == 2


def test_rows_that_are_not_finite_are_dropped_and_counted(caplog) -> None:
    points = paraboloid()
    holed = np.insert(points, 7, [math.nan, 0, 0], axis=0)
    with caplog.at_level(logging.WARNING, logger="parapoint"):
        model = ParaPoint(**TINY).fit(holed)
    assert "dropped 1 of 401 points" in caplog.text
    assert (model.report_["dropped_not_finite"], model.report_["dropped_duplicates"]) == (1, 0)
    assert np.array_equal(model.points_, ParaPoint(**TINY).fit(points).points_)


def test_a_similar_cloud_gets_a_similar_map() -> None:
    # Scaled by a power of two, the networks see the same numbers.
    points = paraboloid()
    first = ParaPoint(**TINY).fit(points).transform(points)
    second = ParaPoint(**TINY).fit(4 * points).transform(4 * points)
    np.testing.assert_allclose(second, 4 * first, rtol=1e-6)


def test_transform_goes_in_batches(fitted: ParaPoint, monkeypatch) -> None:
    points = paraboloid(700)
    whole = fitted.transform(points)
    sizes = []
    keep = Networks.parameterization

    def counted(self: Networks, x: torch.Tensor) -> torch.Tensor:
        sizes.append(len(x))
        return keep(self, x)

    monkeypatch.setattr(Networks, "parameterization", counted)
    monkeypatch.setattr("parapoint.learned.trained_map.BATCH", {"cpu": 256})
    # Products of other sizes round differently, in float32.
    np.testing.assert_allclose(fitted.transform(points), whole, rtol=1e-4, atol=1e-4)
    assert sizes == [256, 256, 188]
    assert fitted.transform(np.empty((0, 3))).shape == (0, 2)


def test_the_inverse_is_the_networks_own(fitted: ParaPoint) -> None:
    uv = fitted.transform(paraboloid())
    with torch.no_grad():
        inside = torch.from_numpy(uv / fitted.frame_.scale).float()
        raw = fitted.map_.networks.surface(inside).numpy()
    points = fitted.inverse_transform(uv)
    np.testing.assert_allclose(points, fitted.frame_.outside(raw), rtol=1e-5)


def test_seams_are_where_neighbours_are_far_apart_in_the_plane(fitted, monkeypatch) -> None:
    # A strip of 300 points in a row is torn between the points 149 and 150.
    x = np.arange(300.0)
    points = np.column_stack([x, 0 * x, 0 * x])
    uv = np.column_stack([np.where(x < 150, 0.4 * x, 0.4 * x + 400), 0 * x])
    monkeypatch.setattr(Fitted, "flatten", lambda *_: uv)
    # Each point sees the nearest 3 of its neighbours: beyond the tear from 148 (or 149) to 151.
    found = np.flatnonzero(fitted.seams(points))
    assert {149, 150} <= set(found) <= {148, 149, 150, 151}
    with pytest.raises(InputError, match="more than 3 points"):
        fitted.seams(points[:3])


def test_nothing_works_before_a_fit(tmp_path) -> None:
    for use in (
        lambda: ParaPoint().transform(np.zeros((1, 3))),
        lambda: ParaPoint().inverse_transform(np.zeros((1, 2))),
        lambda: ParaPoint().seams(),
        lambda: ParaPoint().save(tmp_path),
    ):
        with pytest.raises(InputError, match="not fitted"):
            use()


def test_a_saved_model_maps_as_before(fitted: ParaPoint, tmp_path) -> None:
    fitted.save(tmp_path)
    loaded = ParaPoint.load(tmp_path, device="cpu")
    assert loaded == fitted
    assert loaded.map_.preset == fitted.map_.preset
    assert np.array_equal(loaded.transform(paraboloid()), fitted.transform(paraboloid()))
    assert np.array_equal(loaded.seams(), fitted.seams())
    assert [t.values for t in loaded.trace_] == [t.values for t in fitted.trace_]
    fitted.save(tmp_path)
    assert len(list(tmp_path.glob("*"))) == 2


def test_a_model_of_another_version_or_a_damaged_one_is_one_line(fitted, tmp_path) -> None:
    with pytest.raises(InputError, match="no saved model"):
        ParaPoint.load(tmp_path)
    fitted.save(tmp_path)
    text = (tmp_path / "model.json").read_text()
    (tmp_path / "model.json").write_text(json.dumps({**json.loads(text), "format": 99}))
    with pytest.raises(InputError, match="format version 99; this parapoint reads version 5"):
        ParaPoint.load(tmp_path)
    (tmp_path / "model.json").write_text(text[:-20])
    with pytest.raises(InputError, match="damaged"):
        ParaPoint.load(tmp_path)
    (tmp_path / "model.json").write_text(text)
    tensors = next(tmp_path.glob("*.safetensors"))
    tensors.write_bytes(tensors.read_bytes()[:100])
    with pytest.raises(InputError, match="damaged"):
        ParaPoint.load(tmp_path)


def test_a_model_that_names_tensors_elsewhere_is_refused(fitted, tmp_path) -> None:
    (tmp_path / "other").mkdir()
    fitted.save(tmp_path / "model")
    file = next((tmp_path / "model").glob("*.safetensors"))
    file.rename(tmp_path / "other" / file.name)
    facts = json.loads((tmp_path / "model" / "model.json").read_text())
    for name in (f"../other/{file.name}", str(tmp_path / "other" / file.name)):
        (tmp_path / "model" / "model.json").write_text(json.dumps({**facts, "tensors": name}))
        with pytest.raises(InputError, match="names tensors outside of its folder"):
            ParaPoint.load(tmp_path / "model")


def test_rows_that_were_left_out_are_counted_over_all_components(caplog) -> None:
    points = np.concatenate([paraboloid(), paraboloid()[:30]])
    cloud = PointCloud(np.concatenate([points, points + 1e3]), dropped=7)
    for parts in ("each", "largest"):
        model = ParaPoint(**{**TINY, "iterations": 1, "components": parts}).fit(cloud)
        assert model.report_["dropped_not_finite"] == 7
        assert model.report_["dropped_duplicates"] == 60
    assert "60 of 860 points repeat others and count once" in caplog.text


def test_repeated_rows_are_counted_among_so_many(caplog, monkeypatch) -> None:
    monkeypatch.setattr("parapoint.surfaces.strays.MOST_COMPARED", 300)
    points = paraboloid()[:200]
    fitted_rows(PointCloud(np.concatenate([points, points])))
    assert caplog.messages == ["100 of the first 300 points repeat others and count once"]


class KilledError(Exception):
    pass


def test_a_killed_fit_goes_on_where_it_was(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("parapoint.learned.checkpoint.CHECKPOINT_SECONDS", 0.0)
    points = paraboloid()
    whole = ParaPoint(**TINY).fit(points)
    seen = []

    def kill(progress) -> None:
        seen.append(progress.iteration)
        if progress.iteration == 4:
            raise KilledError

    with pytest.raises(KilledError):
        ParaPoint(**TINY).fit(points, checkpoint=tmp_path, callback=kill)
    assert sorted(path.suffix for path in tmp_path.glob("*")) == [".json", ".safetensors"]
    seen.clear()
    with pytest.raises(InputError, match="other points or settings"):
        ParaPoint(**{**TINY, "seed": 1}).fit(points, checkpoint=tmp_path)
    model = ParaPoint(**TINY).fit(
        points, checkpoint=tmp_path, callback=lambda now: seen.append(now.iteration)
    )
    assert seen == [5, 6]
    assert np.array_equal(model.transform(points), whole.transform(points))
    assert [t.values for t in model.trace_] == [t.values for t in whole.trace_]
    assert not list(tmp_path.glob("*"))


def test_a_time_budget_ends_the_fit() -> None:
    model = ParaPoint(**{**TINY, "iterations": 10**6, "time_budget": 2.0}).fit(paraboloid())
    assert 1 <= model.report_["iterations"] < 10**4
    assert np.isfinite(model.transform(paraboloid())).all()


def test_the_time_that_remains_is_told_by_the_pace_of_the_steps(monkeypatch) -> None:
    now, told = [100.0], []
    monkeypatch.setattr("parapoint.clock.worked", lambda: now[0])

    def tell(progress) -> None:
        told.append(round(progress.remaining, 3))
        now[0] += 0.5  # which is the next step's

    ParaPoint(**{**TINY, "iterations": 10}).fit(paraboloid(), callback=tell)
    assert told == [0.0, *(round(0.5 * k / (k + 1) * (9 - k), 3) for k in range(1, 10))]


def test_the_report_and_the_trace_say_what_was_done(caplog) -> None:
    cloud = PointCloud(paraboloid())
    result = ParaPoint(**TINY).parameterize(cloud, seed=5)
    expected = {"preset": "paper", "points": 150, "iterations": 6, "device": "cpu"}
    assert expected.items() <= result.report.items()
    assert result.report["weights"]["wrap"] == presets.PAPER.wrap_weight
    for name in ("warm_up", "optimizer", "starts"):
        assert result.report[name] == getattr(presets.PAPER, name)
    assert 0 < result.report["processor_seconds"] < 60
    assert [point.iteration for point in result.trace] == [1, 2, 3, 4, 5, 6]
    assert {"wrap", "cycle", "total"} <= result.trace[0].values.keys()
    maps = [point.uv for point in result.trace if point.uv is not None]
    assert len(maps) > 1
    assert all(uv.shape == (400, 2) for uv in maps)
    assert "diverged" not in caplog.text


def test_threads_are_as_before_after_a_fit() -> None:
    before = torch.get_num_threads()
    model = ParaPoint(**TINY, threads=1).fit(paraboloid())
    assert torch.get_num_threads() == before
    assert model.report_["threads"] == 1


def test_a_loaded_model_takes_as_many_threads_as_it_was_fitted_with(tmp_path) -> None:
    ParaPoint(**TINY, threads=1).fit(paraboloid()).save(tmp_path / "model")
    loaded = ParaPoint.load(tmp_path / "model")
    assert loaded.fitted_.map.threads == loaded.threads == 1
    file = tmp_path / "model" / "model.json"
    facts = json.loads(file.read_text())
    (where,) = (
        of for of in (facts, *facts.values()) if isinstance(of, dict) and "is_mirrored" in of
    )
    where["threads"] = 10**6
    file.write_text(json.dumps(facts))
    with pytest.raises(InputError, match="threads must be a whole number"):
        ParaPoint.load(tmp_path / "model")


@pytest.mark.parametrize("is_mirrored", [False, True])
def test_maps_along_the_way_are_seen_from_the_side_of_the_last_one(
    is_mirrored, monkeypatch
) -> None:
    def seen_from(self, *_):
        return dataclasses.replace(self, is_mirrored=is_mirrored)

    monkeypatch.setattr("parapoint.learned.trained_map.TrainedMap.seen_from", seen_from)
    made = ParaPoint(**TINY).parameterize(irregular_disk(), seed=0)
    assert np.array_equal(made.trace[-1].uv, made.uv)


def test_the_report_says_how_many_threads_torch_chose(fitted: ParaPoint) -> None:
    assert fitted.report_["threads"] == torch.get_num_threads()
