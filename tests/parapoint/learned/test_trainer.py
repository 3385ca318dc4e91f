import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from parapoint.learned import losses, trainer
from parapoint.learned.presets import PAPER
from parapoint.learned.trainer import (
    DivergedError,
    Trainer,
    oriented_normals,
    tangent_frames,
)

TINY = replace(PAPER, hidden=(8, 8), embedding=4, subset=100, iterations=40, points=200)


def sphere(count: int = 200) -> np.ndarray:
    points = np.random.default_rng(0).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def tiny(**changes: object) -> Trainer:
    return Trainer(sphere(), replace(TINY, **changes), seed=0, device="cpu")


def weights(of: Trainer) -> np.ndarray:
    return torch.cat([p.detach().flatten() for p in of.networks.parameters()]).numpy()


def test_the_run_goes_from_the_hull_to_a_subset_to_all_points(monkeypatch) -> None:
    seen = []
    keep = Trainer._batch

    def batch(self: Trainer) -> tuple[torch.Tensor, torch.Tensor]:
        points, grid = keep(self)
        seen.append((points.shape[1], len(grid)))
        return points, grid

    monkeypatch.setattr(Trainer, "_batch", batch)
    steps = list(tiny(warm_up=0.25, all_from=0.75).run())
    assert [step.phase for step in steps] == ["hull"] * 10 + ["subset"] * 20 + ["all"] * 10
    assert seen == [(100, 100)] * 30 + [(200, 196)] * 10
    assert [step.iteration for step in steps] == list(range(1, 41))
    assert steps[-1].progress == 1


def test_the_loss_falls() -> None:
    steps = list(tiny(iterations=60, warm_up=0.0, all_from=1.0, learning_rate=1e-2).run())
    totals = [step.losses["total"] for step in steps if step.losses]
    assert np.mean(totals[-10:]) < 0.8 * np.mean(totals[:10])


@pytest.mark.parametrize(
    ("branches", "terms"),
    [
        ("both", {"unwrap", "wrap", "cycle", "distortion", "anti_flip", "total"}),
        ("3d", {"unwrap", "cycle", "distortion", "anti_flip", "total"}),
        ("2d", {"wrap", "cycle", "distortion", "anti_flip", "total"}),
    ],
)
def test_an_ablation_has_the_terms_of_its_branch(branches: str, terms: set[str]) -> None:
    step = next(tiny(branches=branches, iterations=1).run())
    assert step.losses.keys() == terms


def test_the_total_is_the_weighted_sum() -> None:
    of = tiny(iterations=1)
    terms = next(of.run()).losses
    assert of.weights == {
        "unwrap": 0.01, "wrap": 1.0, "cycle": 0.01, "distortion": 0.01, "anti_flip": 0.01,
    }  # fmt: skip
    expected = sum(weight * terms[name] for name, weight in of.weights.items())
    assert terms["total"] == pytest.approx(expected, rel=1e-5)


def test_the_learning_rate_follows_a_cosine() -> None:
    of = tiny()
    assert of._learning_rate() == pytest.approx(1e-3)
    of.iteration = 20
    assert of._learning_rate() == pytest.approx((1e-3 + 1e-5) / 2)
    of.iteration = 40
    assert of._learning_rate() == pytest.approx(1e-5)


def test_the_schedule_follows_a_time_budget_that_ends_first(monkeypatch) -> None:
    clock = iter(range(1000))
    monkeypatch.setattr(trainer.time, "perf_counter", lambda: float(next(clock)))  # 1 s a step
    preset = replace(TINY, warm_up=0.25, all_from=0.75)
    of = Trainer(sphere(), preset, seed=0, device="cpu", time_budget=10.0)
    steps = list(of.run())
    assert len(steps) == 10
    assert steps[4].progress == pytest.approx(0.5)
    assert of._learning_rate() == pytest.approx(1e-5)
    assert [step.phase for step in steps] == ["hull"] * 3 + ["subset"] * 5 + ["all"] * 2


def test_the_same_seed_gives_the_same_weights_and_leaves_torch_s_generator_alone() -> None:
    before = torch.get_rng_state()
    first, second = tiny(), tiny()
    for of in (first, second):
        list(of.run())
    assert np.array_equal(weights(first), weights(second))
    assert torch.equal(torch.get_rng_state(), before)
    other = Trainer(sphere(), TINY, seed=1, device="cpu")
    assert not np.array_equal(weights(other), weights(tiny()))


def test_a_resumed_run_ends_as_one_that_was_not_stopped() -> None:
    whole, first, second = tiny(), tiny(), tiny()
    list(whole.run())
    run = first.run()
    for _ in range(17):
        next(run)
    tensors = {name: t.clone() for name, t in first.tensors().items()}
    second.resume(tensors, first.facts())
    list(second.run())
    assert second.iteration == 40
    assert np.array_equal(weights(whole), weights(second))


def test_a_diverged_run_goes_back_and_on_with_a_smaller_step(monkeypatch) -> None:
    of = tiny()
    keep = Trainer._step

    def step(self: Trainer) -> dict[str, float]:
        if self.iteration == 20:
            for parameter in self.networks.parameters():
                parameter.data.fill_(math.nan)
        return keep(self)

    monkeypatch.setattr(Trainer, "_step", step)
    list(of.run())
    assert of.divergences == 1
    assert np.isfinite(weights(of)).all()
    assert of._learning_rate() == pytest.approx(1e-5 * trainer.SMALLER_STEP)


def test_a_run_that_diverges_twice_says_so(monkeypatch) -> None:
    monkeypatch.setattr(Trainer, "_step", lambda _: {"total": math.nan})
    with pytest.raises(DivergedError, match="twice"):
        list(tiny().run())


def test_the_run_ends_with_the_best_state_of_its_last_phase(monkeypatch) -> None:
    totals = iter([5.0] * 4 + [3.0, 1.0, 2.0, 2.5])
    states = []

    def step(self: Trainer) -> dict[str, float]:
        for parameter in self.networks.parameters():
            parameter.data.fill_(float(self.iteration))
        states.append(self.iteration)
        return {"total": next(totals)}

    monkeypatch.setattr(Trainer, "_step", step)
    of = tiny(iterations=8, warm_up=0.5, all_from=1.0)
    list(of.run())
    assert states == list(range(8))
    assert np.unique(weights(of)).tolist() == [5.0]


def test_a_planar_cloud_warms_up_on_itself() -> None:
    flat = np.column_stack([np.random.default_rng(0).uniform(size=(150, 2)), np.zeros(150)])
    of = Trainer(flat - 0.5, TINY, seed=0, device="cpu")
    assert math.isfinite(next(of.run()).progress)


def test_terms_of_the_objective_use_the_preset(monkeypatch) -> None:
    calls = {}
    monkeypatch.setattr(
        losses, "unwrap_loss", lambda uv, k, s: calls.update(unwrap=(k, s)) or uv.sum() * 0
    )
    monkeypatch.setattr(
        losses, "anti_flip_loss", lambda p, _, k, t: calls.update(flip=(k, t)) or p.sum() * 0
    )
    next(tiny().run())
    assert calls == {"unwrap": (8, 0.1), "flip": (4, math.pi / 2)}


def test_normals_are_oriented_alike() -> None:
    points = sphere(1000)
    outward = (oriented_normals(points) * points).sum(axis=1)
    assert np.abs(outward).min() > 0.9
    assert abs(np.sign(outward).sum()) == 1000
    two = np.concatenate([points, points + 10])  # two components are each oriented
    outward = (oriented_normals(two) * np.concatenate([points, points])).sum(axis=1)
    assert abs(np.sign(outward[:1000]).sum()) == abs(np.sign(outward[1000:]).sum()) == 1000


def test_tangent_frames_are_right_handed_around_the_normals() -> None:
    points = sphere(500)
    first, second = tangent_frames(points)
    np.testing.assert_allclose(np.cross(first, second), oriented_normals(points), atol=1e-12)
    np.testing.assert_allclose((first * second).sum(axis=1), 0, atol=1e-12)


def test_the_unfolding_term_counts_only_with_a_weight() -> None:
    assert "unfolding" not in tiny().weights
    of = tiny(iterations=1, unfolding_weight=0.1)
    terms = next(of.run()).losses
    assert of.weights["unfolding"] == 0.1
    assert 0 <= terms["unfolding"] <= 2
