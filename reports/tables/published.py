"""Published figures beside measured ones, and what may be concluded from the two."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from benchmarks.cases.models import Model, registry

if TYPE_CHECKING:
    from reports.contents import Contents, Label

METRIC = "angle_difference_mean"

AUTHORS = ("SLIM", "ParaPoint", "FAM")
"""Methods with published figures, in the order of the tables."""

SAME_METHOD = {
    "SLIM": ("slim", {"energy": "symmetric_dirichlet"}),
    "ParaPoint": ("parapoint", {"preset": "paper"}),
    "FAM": ("fam", {}),
}
"""The method here, and the parameters it must have, that a published figure speaks of."""

RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE = 0.1, 0.005
"""Two figures agree within the larger of a tenth of the published one and half its last digits."""


@dataclass(frozen=True)
class Verdict:
    """A measured value against the one that was published for the method.

    Attributes:
        case: the model.
        paper_name: the model that it stands for.
        claim: how sure that is.
        label: the method.
        measured: mean over the seeds.
        published: as printed.
        note: how the published figure was obtained, where that matters.
    """

    case: str
    paper_name: str
    claim: str
    label: Label
    measured: float
    published: float
    note: str

    @property
    def tolerance(self) -> float:
        """Up to this difference the two agree."""
        return max(RELATIVE_TOLERANCE * self.published, ABSOLUTE_TOLERANCE)

    @property
    def text(self) -> str:
        """The verdict in words; for a stand-in there is none."""
        if self.claim not in {"same model", "likely"}:
            return "none: stand-in"
        difference = self.measured - self.published
        if abs(difference) <= self.tolerance:
            said = "agrees"
        else:
            said = "lower (better)" if difference < 0 else "higher (worse)"
        return f"{said}; published: {self.note}" if self.note else said


def model(case: str) -> Model | None:
    """The registry's entry of a model, None for a built-in surface or a user's file."""
    return registry().get(case)


def claim_text(case: str) -> str:
    """How sure it is that our file is the papers' model, "" where no paper has it."""
    entry = model(case)
    return entry.claim or "" if entry else ""


def published_values(case: str) -> dict[str, float]:
    """The published conformality of the model that `case` stands for, by method."""
    entry = model(case)
    if entry is None or not entry.paper_name:
        return {}
    return {row.method: row.value for row in entry.published if row.metric == METRIC}


def verdicts(contents: Contents) -> list[Verdict]:
    """Every measured value that a published one speaks of, in the order of the tables."""
    measured = contents.means.set_index(["case", "label"])[METRIC]
    found = []
    for case in contents.cases:
        entry = model(case)
        if entry is None or not entry.paper_name:
            continue
        for label in contents.methods:
            value = measured.get((case, label.short))
            for figure in entry.published:
                method, needed = SAME_METHOD.get(figure.method, ("", {}))
                fits = label.method == method and needed.items() <= label.parameters.items()
                if figure.metric != METRIC or not fits or value is None or math.isnan(value):
                    continue
                found.append(
                    Verdict(
                        case,
                        entry.paper_name,
                        claim_text(case),
                        label,
                        float(value),
                        figure.value,
                        figure.note if figure.note == "cut by hand" else "",
                    )
                )
    return found
