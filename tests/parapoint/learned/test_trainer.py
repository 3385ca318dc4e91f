import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from parapoint import clock
from parapoint.errors import InputError
from parapoint.learned import losses, trainer
from parapoint.learned.networks import Cycle, GridBranch, PointBranch
from parapoint.learned.presets import PAPER, Preset
from parapoint.learned.trainer import (
    DivergedError,
    Trainer,
    objective_terms,
)

TINY = Preset(hidden=(8, 8), embedding=4, subset=100, iterations=40, points=200)


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


def several_starts(**changes: object) -> Trainer:
    return tiny(starts=3, start_share=0.2, warm_up=0.1, all_from=1.0, **changes)


def test_each_start_begins_the_schedule_anew_and_the_last_goes_on() -> None:
    of = several_starts()
    phases, rates = [], []
    for step in of.run():
        phases.append(step.phase)
        rates.append(of._learning_rate())
    # Of 40 steps three starts take 8 each; the one that goes on is then at 8 of 24.
    hull, rest = ["hull"] * 3, ["subset"] * 5
    assert phases == [*hull, *rest, *hull, *rest, *hull, *rest, *["subset"] * 16]
    assert rates[:7] == pytest.approx(rates[8:15])
    assert rates[16:23] == pytest.approx(rates[:7])
    assert rates[23:] == pytest.approx(sorted(rates[23:], reverse=True))
    assert rates[-1] == pytest.approx(1e-5)


def test_the_start_of_lowest_loss_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    of = several_starts()
    keep, ends, at_end = Trainer._step, {}, iter([3.0, 1.0, 2.0])

    def step(self: Trainer) -> dict[str, float]:
        terms = keep(self)
        if self.iteration in (7, 15, 23):
            ends[self._start] = weights(self)
            return {**terms, "total": next(at_end)}
        return {**terms, "total": 9.0}

    monkeypatch.setattr(Trainer, "_step", step)
    run = of.run()
    states = [weights(of) for _ in zip(range(24), run, strict=False)]
    assert np.array_equal(states[23], ends[1])
    assert not np.array_equal(ends[0], ends[1])
    # Each start has weights of its own, not those of the one before.
    assert np.abs(states[7] - ends[0]).max() > 0.1
    assert np.abs(states[15] - states[7]).max() > 0.1


def test_starts_that_would_see_nothing_but_the_hull_are_refused() -> None:
    replace(TINY, starts=3, start_share=0.1, warm_up=0.12)
    with pytest.raises(InputError, match=r"warm_up 0.13 is too much for starts of 0.1"):
        replace(TINY, starts=3, start_share=0.1, warm_up=0.13)
    with pytest.raises(InputError, match=r"start_share must be a number .* at most 0.5"):
        replace(TINY, starts=2, start_share=0.6)


def test_networks_that_are_given_have_one_start() -> None:
    of = several_starts()
    given = Trainer(sphere(), of.preset, seed=0, device="cpu", networks=of.networks)
    assert [step.phase for step in given.run()] == ["hull"] * 4 + ["subset"] * 36


def test_the_learning_rate_follows_a_cosine() -> None:
    of = tiny()
    assert of._learning_rate() == pytest.approx(1e-3)
    of.iteration = 20
    assert of._learning_rate() == pytest.approx((1e-3 + 1e-5) / 2)
    of.iteration = 40
    assert of._learning_rate() == pytest.approx(1e-5)


def test_the_schedule_follows_a_time_budget_that_ends_first(monkeypatch) -> None:
    ticks = iter(range(1000))
    monkeypatch.setattr(clock, "worked", lambda: float(next(ticks)))  # 1 s a step
    preset = replace(TINY, warm_up=0.25, all_from=0.75)
    of = Trainer(sphere(), preset, seed=0, device="cpu", time_budget=10.0)
    steps = list(of.run())
    assert len(steps) == 10
    assert steps[4].progress == pytest.approx(0.5)
    assert of._learning_rate() == pytest.approx(1e-5)
    assert [step.phase for step in steps] == ["hull"] * 3 + ["subset"] * 5 + ["all"] * 2


@pytest.mark.parametrize(
    ("budget", "most", "expected"),
    [
        (5.0, 2_048, 256),  # 1 s a step: too few steps as it is
        (20_000.0, 2_048, 1_024),  # four times as many steps as are enough
        (1e6, 2_048, 2_048),  # the preset's points at most
        (5.0, 200, 200),
    ],
)
def test_a_time_budget_chooses_the_points_of_a_step(
    monkeypatch: pytest.MonkeyPatch, budget: float, most: int, expected: int
) -> None:
    ticks = iter(range(1000))
    monkeypatch.setattr(clock, "worked", lambda: float(next(ticks)))  # 1 s a step
    monkeypatch.setattr(Trainer, "_step", lambda _: {"total": 1.0})
    preset = replace(TINY, subset=most, iterations=10**6)
    of = Trainer(sphere(), preset, seed=0, device="cpu", time_budget=budget)
    seen = [of.subset for _ in zip(range(9), of.run(), strict=False)]
    assert of.subset == pytest.approx(expected, abs=2)
    assert seen[:3] == [min(256, most)] * 3


def test_later_steps_take_all_points_or_a_denser_lattice_under_a_time_budget(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Against the cloud alone: the other terms keep the points of a step."""
    held = []
    wrap_loss = losses.wrap_loss

    def watched(made: torch.Tensor, given: torch.Tensor) -> torch.Tensor:
        held.append((len(made), len(given)))
        return wrap_loss(made, given)

    monkeypatch.setattr(losses, "wrap_loss", watched)

    def sizes(all_from: float, budget: float | None) -> tuple[int, int]:
        preset = replace(TINY, all_from=all_from, warm_up=0.0)
        of = Trainer(sphere(2_000), preset, seed=0, device="cpu", time_budget=budget)
        points, grid = of._batch()
        terms = of.terms(points, grid, of.shape.points)
        assert all(value.isfinite() for value in terms.values())
        return points.shape[1], len(grid)

    assert sizes(0.0, None) == (2_000, 45**2)
    assert sizes(0.0, 10.0) == (100, 100)
    assert sizes(1.0, 10.0) == (100, 100)
    assert held == [(45**2, 2_000), (400, 2_000), (100, 2_000)]


def test_a_run_without_a_time_budget_takes_the_preset_s_points() -> None:
    of = tiny(subset=120)
    next(of.run())
    assert of.subset == 120
    assert 0 < of.processor_seconds < 10


def test_the_same_seed_gives_the_same_weights_and_leaves_torch_s_generator_alone() -> None:
    before = torch.get_rng_state()
    first, second = tiny(), tiny()
    for of in (first, second):
        list(of.run())
    assert np.array_equal(weights(first), weights(second))
    assert torch.equal(torch.get_rng_state(), before)
    other = Trainer(sphere(), TINY, seed=1, device="cpu")
    assert not np.array_equal(weights(other), weights(tiny()))


@pytest.mark.parametrize("optimizer", ["adamw", "soap"])
@pytest.mark.parametrize("stop", [2, 9, 17, 27])
def test_a_resumed_run_ends_as_one_that_was_not_stopped(optimizer: str, stop: int) -> None:
    whole, first, second = (several_starts(optimizer=optimizer, patch=4) for _ in range(3))
    list(whole.run())
    run = first.run()
    for _ in range(stop):
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


def test_the_unfolding_term_counts_only_with_a_weight() -> None:
    assert "unfolding" not in tiny().weights
    of = tiny(iterations=1, unfolding_weight=0.1)
    terms = next(of.run()).losses
    assert of.weights["unfolding"] == 0.1
    assert 0 <= terms["unfolding"] <= 2


def test_the_last_phase_fills_the_time_that_its_own_steps_fit_in(monkeypatch) -> None:
    # Steps of 4 s on the hull, which lasts until 5 of 20 s are over: two of them. Then steps of
    # 1 s: 12 more fit. Judged by the longest step of the hull, the run would end after 9 of them.
    times = iter([0.0, 4.0, *range(8, 40)])
    monkeypatch.setattr(clock, "worked", lambda: float(next(times)))
    preset = replace(TINY, warm_up=0.25, all_from=1.0)
    of = Trainer(sphere(), preset, seed=0, device="cpu", time_budget=20.0)
    steps = list(of.run())
    assert [step.phase for step in steps] == ["hull"] * 2 + ["subset"] * 12
    assert of.seconds == 20.0


def test_the_wrapped_lattice_is_held_against_all_points() -> None:
    # As in the tests of the losses: two points made, three given, 5 / 3 from given to made. Of the
    # first two given points alone it would be (0 + 1) / 2.
    made = torch.tensor([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    given = torch.tensor([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 5.0]])
    uv, axes = made[:, :2], torch.eye(3)[:2, None].expand(2, 2, 3)
    cycle = Cycle(None, GridBranch(uv, made, made, axes, made, uv))
    terms = objective_terms(replace(PAPER, anti_flip_neighbours=1), cycle, given)
    assert float(terms["wrap"]) == pytest.approx(5 / 3, rel=1e-5)
    assert float(terms["cycle"]) == 0


def test_the_objective_adds_up_the_terms_of_both_branches() -> None:
    # Three points on a line in each branch, the last one's normal reversed, K = 1.
    # Cycle: the points are off by 0, 3 and 0, the others all by 2, 4 and 8: 1 + 2 + 4 + 8.
    # Distortion: singular values 3 and 1, 2 and 1, so 2 + 1; of the Gram matrices 8 + 3.
    # Anti-flip: at 0, 6 and 9 the nearest of the last two turn away, at 0, 3 and 9 that of the last
    # one alone: 2/3 + 1/3.
    def line(*x: float) -> torch.Tensor:
        return torch.nn.functional.pad(torch.tensor([x]).float().T, (0, 2))

    def tangents(first: float) -> torch.Tensor:
        axes = torch.zeros(2, 3, 3)
        axes[0, :, 0], axes[1, :, 1] = first, torch.tensor([1.0, 1.0, -1.0])
        return axes

    at = line(0, 3, 9)
    uv = at[:, :2]
    there = PointBranch(
        at, at, uv, at + line(2), line(0, 6, 9), tangents(3.0), torch.zeros(0, 3, 2)
    )
    back = GridBranch(uv, at, at, tangents(2.0), at + line(8), uv + line(4)[:, :2])
    cycle = Cycle(there, back)
    preset = replace(PAPER, unwrap_neighbours=1, anti_flip_neighbours=1)
    terms = {name: float(term) for name, term in objective_terms(preset, cycle, at).items()}
    expected = {"unwrap": 0, "wrap": 0, "cycle": 15, "distortion": 3, "anti_flip": 1}
    assert terms == pytest.approx(expected, abs=1e-5)
    gram = objective_terms(replace(preset, eigenvalues="gram"), cycle, at)
    assert float(gram["distortion"]) == pytest.approx(11)


def test_points_are_moved_by_a_tenth_of_their_spacing_and_their_frames_are_not() -> None:
    # On a sheet of 40 × 40 points at distance 1/40 the noise of each coordinate has a deviation of
    # 1/400; of 4,800 draws it is within 5 % but for four standard errors of 1 %.
    x, y = np.indices((40, 40)).reshape(2, -1) / 40
    points = np.stack([x, y, 0 * x], axis=1)
    preset = replace(TINY, warm_up=0.0, all_from=0.0, unfolding_weight=0.1)
    of = Trainer(points, preset, seed=0, device="cpu")
    moved = (of._batch()[0] - of.prepared(points)).numpy()
    assert moved[0].std() == pytest.approx(1 / 400, rel=0.05)
    assert np.array_equal(moved[1:], np.zeros((2, 1600, 3)))


def test_a_loss_that_rises_tenfold_is_a_divergence_after_which_steps_are_smaller(
    monkeypatch,
) -> None:
    for peak, divergences in ((9.0, 0), (11.0, 1)):
        totals = iter([1.0, peak, 1.0, 1.0])
        monkeypatch.setattr(Trainer, "_step", lambda _, totals=totals: {"total": next(totals)})
        of = tiny(iterations=4, warm_up=0.0, all_from=1.0)
        list(of.run())
        assert of.divergences == divergences
    reduced = of._learning_rate()
    of.divergences = 0
    assert reduced == pytest.approx(0.3 * of._learning_rate())
