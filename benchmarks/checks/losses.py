"""Golden losses: the first steps of each training, which every later one follows from.

    tests/golden/trained/losses_<run>.csv      step, total and terms of the objective

`python -m benchmarks.checks.losses` rewrites them, for a commit that changes the training on
purpose and says by how much.
"""

from __future__ import annotations

import csv
from pathlib import Path

from baselines import registry
from benchmarks.cases import models
from benchmarks.checks.regress import TRAINED, read_rows

MODEL = "hand_1_i_f5000"
STEPS = 20
_SMALL = f"points=200, subset=128, iterations={STEPS}, device=cpu, threads=1"
RUNS = {
    "paper": f"parapoint(preset=paper, {_SMALL})",
    "paper_adamw": f"parapoint(preset=paper, optimizer=adamw, {_SMALL})",
    "learned": f"parapoint(preset=learned, {_SMALL})",
}
"""Runs by name, as specs: every preset, and the paper's once more with the plainer optimiser, which
rounding leads astray later."""

Losses = list[dict[str, float]]
"""Total and terms at each step."""


def first_losses(run: str) -> Losses:
    """The losses of a run's steps.

    Raises:
        MissingModelError: the model is not at hand.
    """
    _, method = registry.method(RUNS[run])
    return [dict(point.values) for point in method.parameterize(models.load(MODEL), seed=0).trace]


def golden_losses(run: str) -> Losses:
    """The losses that the run had."""
    return [
        {name: float(value) for name, value in row.items() if name != "step"}
        for row in read_rows(_path(run))
    ]


def write_losses(run: str, found: Losses) -> None:
    """Make these losses the golden ones."""
    with _path(run).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["step", *found[0]])
        for step, values in enumerate(found, 1):
            writer.writerow([step, *(f"{value:.7g}" for value in values.values())])


def _path(run: str) -> Path:
    return TRAINED.folder / f"losses_{run}.csv"


if __name__ == "__main__":
    for name in RUNS:
        write_losses(name, first_losses(name))
