"""Golden losses: what is put on file is what is read again."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace

import pytest

from benchmarks.checks import losses, regress
from parapoint.surfaces.parameterization import TracePoint


def test_losses_on_file_are_read_as_they_were_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(regress, "GOLDEN", tmp_path)
    monkeypatch.setattr(losses, "TRAINED", dataclasses.replace(regress.TRAINED, name=""))
    found = [{"total": 1 / 3, "wrap": 0.25}, {"total": 1e-9 / 3, "wrap": 0.0}]
    losses.write_losses("paper", found)
    lines = (tmp_path / "losses_paper.csv").read_text().splitlines()
    assert lines == ["step,total,wrap", "1,0.3333333,0.25", "2,3.333333e-10,0"]
    for read, made in zip(losses.golden_losses("paper"), found, strict=True):
        assert read == pytest.approx(made, rel=1e-6)


def test_losses_are_those_of_a_training_on_the_model_with_seed_0(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []

    def parameterize(surface: str, *, seed: int) -> SimpleNamespace:
        asked.append((surface, seed))
        return SimpleNamespace(trace=[TracePoint(step, 0.0, {"total": step}) for step in (1, 2)])

    def method(spec: str) -> tuple[str, SimpleNamespace]:
        asked.append(spec)
        return "parapoint", SimpleNamespace(parameterize=parameterize)

    monkeypatch.setattr("baselines.registry.method", method)
    monkeypatch.setattr("benchmarks.cases.models.load", lambda name: f"the model {name}")
    assert losses.first_losses("learned") == [{"total": 1}, {"total": 2}]
    assert asked == [losses.RUNS["learned"], (f"the model {losses.MODEL}", 0)]
