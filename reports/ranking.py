"""Validity before rank: which maps may be ranked by what, and in which place.

A broken map is shown and never ranked, bold, on a Pareto front or "best". A collapsed one, which
shrinks a part of the surface to nothing, is ranked by angles alone (`benchmarks.metrics.grades`).
Ranks are those of a competition: of two that share the first place the next one is third.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from benchmarks.metrics.grades import GRADES, Grade
from benchmarks.metrics.table import METRICS

ANGLES_AT_POINTS = frozenset(
    {"local_quasi_conformal_mean", "local_quasi_conformal_mean_without_spanning"}
)
"""Metrics of angles that belong to the group of point clouds."""

Mark = Literal["", "best", "second"]
MARKS: dict[int | None, Mark] = {1: "best", 2: "second"}

TIMES = ("seconds", "cpu_seconds")
"""What counts as a metric though it is none of a map: wall time and processor time, in seconds."""
TIME_TIE = 0.05
"""Relative difference up to which two times are equal: a machine repeats itself no better."""
TIE = 1e-3
"""Relative difference up to which two values of another metric are equal."""
COLLAPSED_FLAG = "†"
"""Stands beside the angles of a map that shrinks a part of the surface to nothing."""
MOST_LEFT_OUT = 0.1
"""Share of a method's maps that may be unfit for a rank before its means take no part in ranks."""


def tolerance(metric: str) -> float:
    """The relative difference up to which two values of a metric are equal; 0 for counts."""
    if metric in TIMES:
        return TIME_TIE
    known = METRICS.get(metric)
    return 0.0 if known is not None and known.weighting == "count" else TIE


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


def flagged(text: str, found: str | None, *, angles: bool) -> str:
    """A printed value with COLLAPSED_FLAG where a collapsed map is ranked nevertheless: by angles.

    Args:
        text: the value as printed.
        found: the grade of its map.
        angles: whether the column reads angles alone.
    """
    return f"{text} {COLLAPSED_FLAG}" if angles and found == "collapsed" else text


def means_may_rank(found: Sequence[str], *, angles: bool) -> bool:
    """Whether the means over maps of these grades are ranked in a column."""
    unfit = sum(not may_rank(one, angles=angles) for one in found)
    return unfit <= MOST_LEFT_OUT * len(found)


def worst(found: Sequence[str]) -> Grade | None:
    """The worst of some grades; None where none is known."""
    return next((grade for grade in GRADES if grade in found), None)


def ranks(
    values: Sequence[float | None], texts: Sequence[str], better: str, tie: float = 0.0
) -> list[int | None]:
    """The place of each value, from 1; None for those that take no part.

    Two values share a place where they print alike, or where they differ by no more than the
    metric's own tolerance. Both are held against the best value of the place, so that a chain of
    small steps does not end in one place.

    Args:
        values: None or not finite for what takes no part.
        texts: the values as printed.
        better: "lower" or "higher".
        tie: relative difference up to which two values are equal (`tolerance`).
    """
    places: list[int | None] = [None] * len(values)
    taking_part = [
        (value if better == "lower" else -value, at)
        for at, value in enumerate(values)
        if value is not None and math.isfinite(value)
    ]
    place, first, text = 0, 0.0, ""
    for count, (value, at) in enumerate(sorted(taking_part), start=1):
        equal = texts[at] == text or abs(value - first) <= tie * abs(first)
        if count == 1 or not equal:
            place, first, text = count, value, texts[at]
        places[at] = place
    return places


def marks(
    values: Sequence[float | None], texts: Sequence[str], better: str, tie: float = 0.0
) -> list[Mark]:
    """The marks of the first two places, best and second; arguments as for `ranks`.

    Where all that take part share the first place, nobody is best.
    """
    places = ranks(values, texts, better, tie)
    if all(place in {None, 1} for place in places):
        return [""] * len(places)
    return [MARKS.get(place, "") for place in places]
