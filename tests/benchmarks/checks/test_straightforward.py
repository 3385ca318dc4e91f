"""The straightforward implementation is the same method: its gradients, on a few points."""

import dataclasses
import time
from collections.abc import Iterator
from typing import Any

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
from parapoint import InputError, Mesh
from parapoint.learned.presets import PAPER
from parapoint.learned.trainer import Trainer
from parapoint.surfaces.surface import FloatArray


def test_it_trains() -> None:
    points = np.random.default_rng(0).normal(size=(120, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    maps = straightforward_maps(points, points[:7], 0)
    begin = time.process_time()
    (first, before), *_, (last, after) = [next(maps) for _ in range(4)]
    assert 0 < first < last <= time.process_time() - begin
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


def test_the_lattice_has_about_as_many_points_as_the_cloud(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the square from -1 to 1, in which the networks' maps lie."""
    lattices: list[torch.Tensor] = []

    def loss(networks: Any, _: object, grid: torch.Tensor) -> torch.Tensor:
        lattices.append(grid)
        total: torch.Tensor = sum(weight.sum() for weight in networks.parameters())
        return total

    monkeypatch.setattr(straightforward, "straightforward_loss", loss)
    points = np.random.default_rng(0).normal(size=(120, 3))
    next(straightforward_maps(points, points[:7], 0))
    (lattice,) = lattices
    assert lattice.shape == (11 * 11, 2)
    assert len(lattice.unique(dim=0)) == len(lattice)
    assert lattice.amin(0).tolist() == [-1, -1]
    assert lattice.amax(0).tolist() == [1, 1]


SQUARE = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])


def test_a_race_measures_after_twice_as_many_steps_until_time_is_over(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A step of the straightforward way takes a second here, and the maps are all isometries."""
    seeds: list[int] = []

    class Rival:
        def __init__(self, *preset: str, seed: int, **options: object) -> None:
            assert options == ({"time_budget": 5.0, "device": "cpu"} if preset else {})
            seeds.append(seed)
            self.report_ = {"iterations": 30} if preset else {}

        def fit(self, _: Mesh) -> "Rival":
            return self

        def transform(self, points: FloatArray) -> FloatArray:
            return points[:, :2]

    def maps(_: object, at: FloatArray, seed: int) -> Iterator[tuple[float, FloatArray]]:
        seeds.append(seed)
        return ((float(step), at[:, :2]) for step in range(1, 100))

    def points(mesh: Mesh, count: int, seed: int) -> FloatArray:
        seeds.append(seed)
        assert count == PAPER.points
        return mesh.vertices

    monkeypatch.setattr(straightforward.models, "load", lambda _: SQUARE)
    monkeypatch.setattr("parapoint.computed.computed_map.ComputedMap", Rival)
    monkeypatch.setattr("parapoint.learned.parapoint.ParaPoint", Rival)
    monkeypatch.setattr("parapoint.surfaces.sampling.training_points", points)
    monkeypatch.setattr(straightforward, "straightforward_maps", maps)
    computed, learned, *plain = race("square", 5.0)
    assert (computed.what, computed.iterations) == ("computed", 0)
    assert (learned.what, learned.iterations) == ("learned", 30)
    assert 0 <= computed.cpu_seconds < 1
    assert [(row.iterations, row.cpu_seconds) for row in plain] == [(1, 1), (2, 2), (4, 4), (5, 5)]
    assert {row.what for row in plain} == {"straightforward"}
    assert [row.angle_difference for row in (computed, learned, *plain)] == pytest.approx([0] * 6)
    assert seeds == [0] * 4
    list(race("square", 5.0, seed=7))
    assert seeds[4:] == [7] * 4


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
