"""Validity before rank: which maps may be ranked by what, and in which place.

A broken map is shown and never ranked, bold, on a Pareto front or "best". A collapsed one, which
shrinks a part of the surface to nothing, is ranked by angles alone (`benchmarks.metrics.grades`).
Ranks are those of a competition: of two that share the first place the next one is third.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from benchmarks.metrics.grades import GRADES, Grade, grade
from benchmarks.metrics.table import METRICS

FROM_POINTS = frozenset({"parapoint", "computed", "fam", "nuvo", "meshed"})
"""Methods whose maps are made of points alone, so that a few flips at a face are forgiven."""
ANGLES_AT_POINTS = frozenset(
    {"local_quasi_conformal_mean", "local_quasi_conformal_mean_without_spanning"}
)
"""Metrics of angles that belong to the group of point clouds."""


def is_of_angles(metric: str) -> bool:
    """Whether a metric reads angles alone."""
    known = METRICS.get(metric)
    return metric in ANGLES_AT_POINTS or (known is not None and known.group == "conformal")


def may_rank(found: str | None, *, angles: bool) -> bool:
    """Whether a map of a grade is ranked in a column, of angles or of anything else.

    Args:
        found: a grade, or None where it is not known: an old result, a failed cell.
        angles: whether the column reads angles alone.
    """
    return found != "broken" and (angles or found != "collapsed")


def grade_of(method: str, values: Mapping[str, object]) -> Grade | None:
    """The grade of a cell; None where it has no map or lacks a metric that the grade needs.

    Args:
        method: registry name.
        values: the cell's metrics by name; those it does not have are missing or nan.
    """
    known = {
        name: float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and not math.isnan(value)
    }
    try:
        return grade(known, of_cloud=method in FROM_POINTS)
    except KeyError:
        return None


def worst(found: Sequence[str]) -> Grade | None:
    """The worst of some grades; None where none is known."""
    return next((grade for grade in GRADES if grade in found), None)


def ranks(values: Sequence[float | None], texts: Sequence[str], better: str) -> list[int | None]:
    """The place of each value, from 1; None for those that take no part.

    Args:
        values: None or not finite for what takes no part.
        texts: the values as printed: what prints alike is equal.
        better: "lower" or "higher".
    """
    places: list[int | None] = [None] * len(values)
    taking_part = [
        (value if better == "lower" else -value, at)
        for at, value in enumerate(values)
        if value is not None and math.isfinite(value)
    ]
    before = ""
    place = 0
    for count, (_, at) in enumerate(sorted(taking_part), start=1):
        if count == 1 or texts[at] != before:
            place, before = count, texts[at]
        places[at] = place
    return places
