"""Published figures beside measured ones, and what may be concluded from the two.

Each published figure of a model has a verdict: reproduced, better, worse, or not comparable; and a
reason. It is not comparable where our file is no more than a stand-in for the paper's, where the
map was got in another way, where our map is broken, or where the method has not run here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from benchmarks.cases.derived import is_drawn, undrawn
from benchmarks.cases.models import Model, PublishedFigure, registry
from benchmarks.metrics.table import METRICS
from reports.ranking import may_rank

if TYPE_CHECKING:
    from reports.contents import Contents
    from reports.labels import Label

METRIC = "angle_difference_mean"
"""The metric of which tables have columns of published figures."""

AUTHORS = ("SLIM", "ParaPoint", "FAM")
"""Methods with published figures, in the order of the tables."""

SAME_METHOD: dict[str, tuple[str, dict[str, object]]] = {
    "SLIM": ("slim", {"energy": "symmetric_dirichlet"}),
    "ParaPoint": ("parapoint", {"preset": "paper"}),
    "FAM": ("fam", {}),
}
"""The method here, and the parameters it must have, that a published figure speaks of."""

FREE: dict[str, frozenset[str]] = {
    "parapoint": frozenset(
        {
            *("preset", "points", "iterations", "subset", "time_budget"),
            *("components", "seed", "device", "threads"),
        }
    ),
}
"""The parameters that make no variant of a method with presets: how much it may take, and where.

Any other one is None, which takes the preset's value, or departs from what was published.
"""

CUT_BY_HAND = "cut by hand"
"""The note of a figure whose model somebody cut by hand. It is compared with maps of the model cut
along a seam that was drawn here, and with no other."""

Word = Literal["reproduced", "better", "worse", "not comparable"]


@dataclass(frozen=True)
class Verdict:
    """A published figure, and what was measured here for the same method and model.

    Attributes:
        case: the model.
        claim: how sure it is that our file is the paper's model.
        figure: the published figure.
        label: the method here; None where it has not run.
        measured: mean over the seeds; None where there is no map.
        grade: of the map, the worst of the seeds; "" where there is none.
    """

    case: str
    claim: str
    figure: PublishedFigure
    label: Label | None
    measured: float | None
    grade: str

    @property
    def word(self) -> Word:
        """The verdict."""
        return self._judged[0]

    @property
    def why(self) -> str:
        """The reason for the verdict, in a few words."""
        return self._judged[1]

    @property
    def text(self) -> str:
        """Verdict and reason."""
        return f"{self.word}: {self.why}"

    @property
    def _judged(self) -> tuple[Word, str]:
        if self.label is None:
            return "not comparable", "the method has not run here"
        if self.measured is None:
            return "not comparable", "there is no map here"
        if self.claim not in {"same model", "likely"}:
            return "not comparable", "our file is a stand-in"
        if self.figure.note == CUT_BY_HAND and not is_drawn(self.case):
            return "not comparable", f"published: {CUT_BY_HAND}"
        metric = METRICS[self.figure.metric]
        if not may_rank(self.grade, angles=metric.group == "conformal"):
            return "not comparable", f"our map is {self.grade}"
        seam = ", along our own seam, as theirs is not public" if is_drawn(self.case) else ""
        difference = self.measured - self.figure.value
        if abs(difference) <= self.figure.tolerance:
            return "reproduced", f"within {self.figure.tolerance:.3f}{seam}"
        side = "lower" if difference < 0 else "higher"
        said = f"{side} by {abs(difference):.3f}{seam}"
        if self.grade == "collapsed":
            said += ", but our map is collapsed"
        return ("better" if side == metric.better else "worse"), said


def model(case: str) -> Model | None:
    """The registry's entry of a model, None for a built-in surface or a user's file.

    That of a model cut along a drawn seam is the model's.
    """
    return registry().get(undrawn(case))


def figures(case: str) -> tuple[PublishedFigure, ...]:
    """The published figures that speak of a case: of a model cut by hand, those of one so cut."""
    entry = model(case)
    if entry is None or not entry.paper_name:
        return ()
    return tuple(row for row in entry.published if not is_drawn(case) or row.note == CUT_BY_HAND)


def claim_text(case: str) -> str:
    """How sure it is that our file is the papers' model, "" where no paper has it."""
    entry = model(case)
    return entry.claim or "" if entry else ""


def claim_reason(case: str) -> str:
    """The reason for `claim_text`, in a sentence; "" where there is none."""
    entry = model(case)
    return entry.claim_reason if entry else ""


def published_values(case: str) -> dict[str, float]:
    """The published conformality of the model that `case` stands for, by method."""
    return {row.method: row.value for row in figures(case) if row.metric == METRIC}


def verdicts(contents: Contents) -> list[Verdict]:
    """Every published figure of the models of a suite, in the order of the tables.

    A figure has a verdict for each method here that it speaks of, such as SLIM after one iteration
    and after twenty; and one that says so where there is none.
    """
    found = []
    for case in contents.cases:
        for figure in figures(case):
            labels = [label for label in contents.methods if _speaks_of(figure, label)]
            found += list(_verdicts(contents, case, figure, labels))
    return found


def _speaks_of(figure: PublishedFigure, label: Label) -> bool:
    """Whether a figure was published for a method, with these parameters: not for a variant."""
    method, needed = SAME_METHOD.get(figure.method, ("", {}))
    given = {name: value for name, value in label.parameters.items() if value is not None}
    is_variant = not given.keys() <= FREE.get(method, given.keys())
    return label.method == method and needed.items() <= given.items() and not is_variant


def _verdicts(
    contents: Contents, case: str, figure: PublishedFigure, labels: list[Label]
) -> Iterator[Verdict]:
    """The verdicts of a figure, one for each label."""
    claim = claim_text(case)
    if not labels:
        yield Verdict(case, claim, figure, None, None, "")
    for label in labels:
        record: dict[str, Any] = contents.records.get((case, label.short)) or {}
        value = record.get(figure.metric)
        known = isinstance(value, float) and not math.isnan(value)
        yield Verdict(
            case, claim, figure, label, value if known else None, str(record.get("grade") or "")
        )
