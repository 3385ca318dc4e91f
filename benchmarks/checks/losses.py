"""Golden losses: the first steps of each training, on which all later steps depend.

    tests/golden/trained/losses_<run>.csv      step, total and terms of the objective

`python -m benchmarks.checks.losses` rewrites them. A commit that does so changes the training on
purpose, and says by how much the losses move.
"""

from __future__ import annotations

import csv
from pathlib import Path

from baselines import registry
from benchmarks.cases import models
from benchmarks.checks.regress import TRAINED, read_rows

MODEL = "hand_1_i_f5000"
"""The model that is trained on."""
STEPS = 20
"""Steps of each training."""
_SMALL = f"points=200, subset=128, iterations={STEPS}, device=cpu, threads=1"
RUNS = {
    "paper": f"parapoint(preset=paper, {_SMALL})",
    "paper_adamw": f"parapoint(preset=paper, optimizer=adamw, {_SMALL})",
    "learned": f"parapoint(preset=learned, {_SMALL})",
}
"""The specs of the runs by name: each preset, and the paper's once more with AdamW. Rounding makes
two runs drift apart; with AdamW it takes more steps until this shows."""

Losses = list[dict[str, float]]
"""For each step the total of the objective and its terms, by name."""


def first_losses(run: str) -> Losses:
    """Train anew, and return the losses of a run.

    Raises:
        MissingModelError: the model is not at hand.
    """
    _, method = registry.method(RUNS[run])
    return [dict(point.values) for point in method.parameterize(models.load(MODEL), seed=0).trace]


def golden_losses(run: str) -> Losses:
    """The losses that are on file for a run."""
    return [
        {name: float(value) for name, value in row.items() if name != "step"}
        for row in read_rows(_path(run))
    ]


def write_losses(run: str, found: Losses) -> None:
    """Put these losses on file."""
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
