"""Golden losses: what is put on file is what is read again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from benchmarks.checks import losses, regress


def test_losses_on_file_are_read_as_they_were_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(regress, "GOLDEN", tmp_path)
    monkeypatch.setattr(losses, "TRAINED", dataclasses.replace(losses.TRAINED, name=""))
    found = [{"total": 1 / 3, "wrap": 0.25}, {"total": 1e-9 / 3, "wrap": 0.0}]
    losses.write_losses("paper", found)
    lines = (tmp_path / "losses_paper.csv").read_text().splitlines()
    assert lines == ["step,total,wrap", "1,0.3333333,0.25", "2,3.333333e-10,0"]
    for read, made in zip(losses.golden_losses("paper"), found, strict=True):
        assert read == pytest.approx(made, rel=1e-6)
