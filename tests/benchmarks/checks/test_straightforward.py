"""The straightforward implementation is the same method: its gradients, on a few points."""

import dataclasses

import numpy as np
import pytest
import torch

from benchmarks.checks import straightforward
from benchmarks.checks.straightforward import (
    race,
    race_table,
    straightforward_loss,
    straightforward_maps,
    straightforward_networks,
)
from parapoint import InputError
from parapoint.learned.presets import PAPER
from parapoint.learned.trainer import Trainer


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


def test_the_trainer_has_its_loss_and_its_gradients() -> None:
    """Two ways to one objective: forward-mode tangents and trees, double backward and distances."""
    points = np.random.default_rng(0).normal(size=(120, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    preset = dataclasses.replace(PAPER, warm_up=0.0, perturbation=0.0, iterations=1, all_from=0.0)
    trainer = Trainer(points, preset, seed=0, device="cpu")
    trainer.networks.double()
    with torch.no_grad():  # as they are drawn, tangents are a thousandth and hide two terms
        for parameter in trainer.networks.parameters():
            parameter.mul_(2.5)
    rows, grid = (batch.double() for batch in trainer._batch())
    terms = trainer.terms(rows, grid, rows[0])
    total = torch.stack([trainer.weights[name] * value for name, value in terms.items()]).sum()
    total.backward()

    plain = straightforward_networks().double()
    net = trainer.networks
    stacks = {
        "deform_embed": net.deform.embed, "deform_move": net.deform.offset,
        "cut_embed": net.cut.embed, "cut_move": net.cut.offset,
        "unwrap": net.unwrap, "wrap": net.wrap, "stitch": net.stitch,
    }  # fmt: skip
    pairs = [
        pair
        for name, stack in stacks.items()
        for pair in zip(stack.layers, plain[name][::2], strict=True)
    ]
    with torch.no_grad():
        for layer, linear in pairs:
            linear.weight.copy_(layer[:-1].T)
            linear.bias.copy_(layer[-1])
    expected = straightforward_loss(plain, rows[0], grid)
    expected.backward()
    torch.testing.assert_close(total, expected, rtol=1e-6, atol=0)
    for layer, linear in pairs:
        own = torch.cat([linear.weight.grad.T, linear.bias.grad[None]])
        difference, size = (layer.grad - own).norm(), own.norm()
        assert float(difference) <= 1e-4 * float(size)


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
