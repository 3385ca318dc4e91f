"""What stands for a method over several models: mean, median and worst, and over which models."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from reports.contents import Contents, number
from reports.labels import Label


def worst_value(values: Sequence[float], better: str) -> float:
    """The value that is farthest from good, by the metric's direction."""
    return float(min(values) if better == "higher" else max(values))


STATISTICS: Mapping[str, Callable[[Sequence[float], str], float]] = {
    "mean": lambda values, _: float(np.mean(values)),
    "median": lambda values, _: float(np.median(values)),
    "worst": worst_value,
}
"""By name: of values and the better direction of their metric ("lower" or "higher"), one number."""


def own_values(
    contents: Contents, label: Label, metric: str, cases: Sequence[str] | None = None
) -> list[float]:
    """The values of a method, one a model (mean over its seeds), where it has one.

    Over the models of `cases`, or over all.
    """
    found = (
        number(contents.records.get((case, label.short)), metric)
        for case in (contents.cases if cases is None else cases)
    )
    return [value for value in found if value is not None]


def common_cases(contents: Contents, cases: Sequence[str], metric: str = "") -> list[str]:
    """Those of `cases` on which every method gave a map that gives one on any of them.

    Nobody gains by failing on the hard ones. With a `metric`, models of which it is not defined,
    such as angles of faces on a cloud of points, are left out first.
    """
    shorts = [label.short for label in contents.methods]
    if metric:
        cases = [
            case
            for case in cases
            if any(number(contents.records.get((case, s)), metric) is not None for s in shorts)
        ]
    good = {key for key, record in contents.records.items() if record["ok"] > 0}
    able = [short for short in shorts if any((case, short) in good for case in cases)]
    return [case for case in cases if able and all((case, short) in good for short in able)]


def common_values(
    contents: Contents, label: Label, metric: str, cases: Sequence[str]
) -> list[float]:
    """The values of a method on the models `cases`; none at all where it lacks one of them.

    A mean over some of the models would stand beside means over all of them.
    """
    found = own_values(contents, label, metric, cases)
    return found if len(found) == len(cases) else []


def statistic(name: str, values: Sequence[float], better: str) -> float | None:
    """The statistic `name` of STATISTICS; None where there are no values."""
    return STATISTICS[name](values, better) if values else None
