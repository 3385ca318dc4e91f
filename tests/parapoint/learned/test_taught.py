"""Training from a computed start, and that the five networks hold the map and nothing else does."""

import logging
from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

from parapoint import ParaPoint
from parapoint.learned import losses, parapoint
from parapoint.learned import taught as teaching
from parapoint.learned.batches import lattice
from parapoint.learned.features import FLOOR, FeatureNetworks, Features, GatedCut
from parapoint.learned.networks import ACTIVATIONS, SubNetworks
from parapoint.learned.presets import LEARNED, LEARNED_FROM_HULL
from parapoint.learned.start import Start, computed_start
from parapoint.learned.taught import TaughtTrainer, distance_loss, gate_loss, jacobian_loss

TINY = replace(LEARNED, hidden=(32, 32), embedding=4, features=8, gates=4, subset=100)


def cap(count: int = 400) -> np.ndarray:
    """Points of a sphere without its southern quarter."""
    points = np.random.default_rng(0).normal(size=(2 * count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return points[points[:, 2] > -0.5][:count]


@pytest.fixture(scope="module")
def start() -> Start:
    return computed_start(cap(), TINY.gates)


def trainer(start: Start, **changes: object) -> TaughtTrainer:
    return TaughtTrainer(start, replace(TINY, **changes), seed=0, device="cpu")


@pytest.fixture(scope="module")
def taught(start: Start) -> SubNetworks:
    run = trainer(start, iterations=200, learning_rate=2e-2)
    for _ in run.run():
        pass
    assert isinstance(run.networks, SubNetworks)
    return run.networks


def errors(networks: SubNetworks, start: Start) -> dict[str, float]:
    """Mean distances of the map from the start's, of the inverse and of the lattice's image."""
    points = torch.as_tensor(start.points).float()
    wanted = np.einsum("cni,ni->nc", start.gradients, start.points) + start.offsets
    with torch.no_grad():
        uv = networks.parameterization(points)
        back = networks.surface(uv)
        spread = networks.surface(networks.deform(lattice(20, torch.Generator())[None])[0])
    return {
        "map": float(np.linalg.norm(uv.numpy() - wanted, axis=1).mean()),
        "inverse": float((back - points).norm(dim=1).mean()),
        "lattice": float(losses.wrap_loss(spread, points)),
    }


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("cut", "map"),
        ("unwrap", "map"),
        ("wrap", "inverse"),
        ("stitch", "inverse"),
        ("deform", "lattice"),
    ],
)
def test_noise_on_any_network_spoils_the_map_or_its_inverse(
    taught: SubNetworks, start: Start, name: str, of: str
) -> None:
    before = errors(taught, start)[of]
    kept = {k: v.clone() for k, v in taught.state_dict().items()}
    generator = torch.Generator().manual_seed(1)
    with torch.no_grad():
        for parameter in getattr(taught, name).parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=generator) * parameter.std())
    spoilt = errors(taught, start)[of]
    taught.load_state_dict(kept)
    assert before < 0.2
    assert spoilt > 1.4 * before


def test_the_map_is_made_of_networks_alone(taught: SubNetworks) -> None:
    """Nothing but weights and the random frequencies of features is kept, and no fitted point."""
    kept = {name for name, _ in taught.named_buffers()}
    assert {name.rsplit(".", 1)[1] for name in kept} == {"frequencies", "amplitudes"}
    assert all("features" in name for name in kept)


def test_every_network_is_trained(start: Start) -> None:
    run = trainer(start, iterations=60, learning_rate=1.5e-2)
    before = {name: of.clone() for name, of in run.networks.state_dict().items()}
    for _ in run.run():
        pass
    moved = {
        name.split(".")[0]
        for name, of in run.networks.state_dict().items()
        if not torch.equal(of, before[name])
    }
    assert moved == {"cut", "deform", "stitch", "unwrap", "wrap"}


def test_gates_learn_the_banks_and_stay(start: Start) -> None:
    run = trainer(start, iterations=500)
    assert isinstance(run.networks, FeatureNetworks)
    cut = run.networks.cut
    points, gates = (torch.as_tensor(of).float() for of in (start.points, start.gates))
    side, _ = cut.sides(points)
    sure = gates.abs() > 0.5
    assert sure.any()
    assert ((side * gates)[sure] > 0).float().mean() > 0.98
    assert not any(parameter.requires_grad for parameter in cut.gate.parameters())


def test_the_seed_decides_all(start: Start) -> None:
    maps = []
    for _ in range(2):
        run = trainer(start, iterations=5)
        for _ in run.run():
            pass
        assert isinstance(run.networks, SubNetworks)
        maps.append(run.networks.parameterization(torch.as_tensor(start.points).float()))
    assert torch.equal(*maps)


def test_features_have_the_tangents_of_their_points() -> None:
    features = Features(3, 5, torch.Generator().manual_seed(0)).double()
    x = torch.randn(4, 3, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    axes = torch.eye(3, dtype=torch.float64)[:, None].expand(3, 4, 3)
    made = features(torch.cat([x[None], axes]))
    slopes = torch.autograd.functional.jacobian(lambda at: features(at[None])[0].sum(0), x)
    torch.testing.assert_close(made[1:], slopes.permute(2, 1, 0))


def test_a_gate_is_shut_where_its_reach_is_small_and_jumps_where_it_is_not() -> None:
    cut = GatedCut(
        1, 2, (4,), activation=ACTIVATIONS["squareplus"], generator=torch.Generator().manual_seed(0)
    )
    seen = []
    cut.offset.register_forward_hook(lambda _, given, __: seen.append(given[0][..., :1]))
    for reach in (0.0, 1 + FLOOR):
        made = torch.tensor([[[-9.0, reach], [9.0, reach]], [[1.0, 0.0], [1.0, 0.0]]])
        cut.gate.forward = lambda _, made=made: made  # type: ignore[method-assign]
        cut(torch.zeros(2, 2, 3))
    torch.testing.assert_close(seen[0], torch.zeros(2, 2, 1))
    torch.testing.assert_close(seen[1][0, :, 0], torch.tensor([-1.0, 1.0]))
    torch.testing.assert_close(seen[1][1, :, 0], torch.zeros(2))


def test_losses_of_what_is_taught() -> None:
    place = torch.zeros(2, 2)
    assert distance_loss(place, place) == 0
    assert distance_loss(place, place + torch.tensor([3.0, 4.0])) == pytest.approx(5, rel=0.01)
    near, nearer = (float(distance_loss(place, place + of)) for of in (1e-3, 5e-4))
    assert near == pytest.approx(4 * nearer, rel=0.05)
    right = torch.eye(2)[:, None].repeat(1, 3, 1)
    assert jacobian_loss(right, right) == 0
    assert jacobian_loss(2 * right, right) == pytest.approx(1)
    assert jacobian_loss(100 * right, right) == 4  # a fold of the start does not drown the rest
    gates = torch.tensor([[1.0, -1.0, 0.0]])
    sure = torch.tensor([[50.0, -50.0, 7.0]])
    assert gate_loss(sure, gates.abs(), gates) == pytest.approx(0)
    assert gate_loss(-sure, gates.abs(), gates) == pytest.approx(100)
    assert gate_loss(sure, gates.abs() + 0.1, gates) == pytest.approx(0.03)


def test_where_no_map_can_be_computed_the_hull_is_the_start(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    tiny = replace(LEARNED_FROM_HULL, hidden=(8, 8), embedding=4, subset=100)
    monkeypatch.setattr(parapoint.presets, "LEARNED_FROM_HULL", tiny)
    ball = np.concatenate([cap(150) + 3.0 * k for k in range(3)])
    with caplog.at_level(logging.WARNING, logger="parapoint"):
        model = ParaPoint(iterations=5, device="cpu").fit(ball)
    assert model.report_["start"] == "hull"
    assert "no map could be computed, so the hull is the start" in caplog.text
    assert np.isfinite(model.transform(ball)).all()


def test_a_taught_model_comes_back_from_its_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path
) -> None:
    monkeypatch.setitem(parapoint.presets.PRESETS, "learned", TINY)
    model = ParaPoint(iterations=10, device="cpu").fit(cap())
    assert model.report_["start"] == "computed"
    model.save(tmp_path / "model")
    again = ParaPoint.load(tmp_path / "model")
    assert_array_equal(again.transform(cap()), model.transform(cap()))
    uv = model.transform(cap())
    assert_array_equal(again.inverse_transform(uv), model.inverse_transform(uv))


class KilledError(Exception):
    pass


def test_a_killed_fit_from_a_computed_start_goes_on_where_it_was(
    monkeypatch: pytest.MonkeyPatch, tmp_path
) -> None:
    monkeypatch.setitem(parapoint.presets.PRESETS, "learned", TINY)
    monkeypatch.setattr("parapoint.learned.checkpoint.CHECKPOINT_SECONDS", 0.0)

    def kill(progress) -> None:
        if progress.iteration == 5:
            raise KilledError

    model = ParaPoint(iterations=8, device="cpu")
    whole = model.fit(cap()).transform(cap())
    with pytest.raises(KilledError):
        model.fit(cap(), checkpoint=tmp_path, callback=kill)
    seen = []
    model.fit(cap(), checkpoint=tmp_path, callback=lambda now: seen.append(now.iteration))
    assert seen == [0, 6, 7, 8]  # the start is computed again
    assert_array_equal(model.transform(cap()), whole)


def test_gates_are_taught_for_a_share_of_the_time(
    start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = []
    monkeypatch.setattr(teaching, "teach_gates", lambda *given: limits.append(given[3:]))
    for steps, budget in ((300, None), (10_000, 100.0)):
        preset = replace(TINY, iterations=steps)
        TaughtTrainer(start, preset, seed=0, device="cpu", time_budget=budget)
    assert limits == [(300, np.inf), (teaching.GATE_STEPS, 6.0)]
