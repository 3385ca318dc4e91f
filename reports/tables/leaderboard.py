"""Who is best at what, on what: what the page says at first sight."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cache
from typing import Any

from benchmarks.metrics.table import METRICS
from reports.contents import (
    ANGLE,
    AREA,
    BIJECTIVE,
    FLIPPED,
    ISOMETRIC,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
    Contents,
)
from reports.pictures.names import slug
from reports.ranking import TIMES, may_rank, ranks
from reports.tables.table import metric_column

MEASURES = {
    "Angles": ANGLE,
    "Areas": AREA,
    "Angles and areas": ISOMETRIC,
    "One to one": BIJECTIVE,
    "Angles at points": POINT_ANGLE,
    "Areas at points": POINT_AREA,
    "Speed": "seconds",
}
"""What the methods are compared by at first sight, and the metric that stands for it."""

SHOWN = (
    *(ANGLE, AREA, ISOMETRIC, FLIPPED, "overlapped_fraction", SPANNING),
    *(POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS),
    *TIMES,
)
"""The metrics that the leaderboard shows before any is chosen."""


@dataclass(frozen=True)
class Winner:
    """The method that is best at one thing, or several that are equal.

    Attributes:
        names: short names of the methods.
        text: what they reached, printed.
    """

    names: tuple[str, ...]
    text: str


def winner(contents: Contents, case: str, metric: str) -> Winner | None:
    """The best value of `metric` on a model among the methods with one chart; None without any.

    Maps whose grade is too low for that (`reports.ranking`) take no part. Equals win together.
    """
    column = metric_column(metric)
    fit = {
        str(record["label"]): float(record[metric])
        for record in _by_case(contents).get(case, ())
        if math.isfinite(record[metric]) and may_rank(record["grade"], angles=column.angles)
    }
    if not fit or (metric == BIJECTIVE and max(fit.values()) < 1):
        return None
    texts = [column.shown(value) for value in fit.values()]
    places = ranks([*fit.values()], texts, column.better, column.tie)
    names = tuple(name for name, place in zip(fit, places, strict=True) if place == 1)
    if metric == BIJECTIVE:
        return Winner(names, "")
    return Winner(names, min(zip(places, texts, strict=True))[1] + " s" * (metric in TIMES))


@cache
def _by_case(contents: Contents) -> dict[str, list[dict[str, Any]]]:
    """The rows of `contents.means` with a map of one chart, model by model."""
    means = contents.means
    rivals = means[(means["ok"] > 0) & ~means["label"].isin(contents.unranked)]
    found: dict[str, list[dict[str, Any]]] = {}
    for record in rivals.to_dict("records"):
        found.setdefault(record["case"], []).append({str(k): v for k, v in record.items()})
    return found


@dataclass(frozen=True)
class Glance:
    """Who is best at one thing over all models.

    Attributes:
        title: at what.
        metric: by which it is told.
        names: short names of the methods that are best on most models, equals together.
        count: on how many.
        of: of how many on which any method has a value.
        next: the method behind, and ParaPoint where it is neither, with their counts.
    """

    title: str
    metric: str
    names: tuple[str, ...]
    count: int
    of: int
    next: tuple[str, ...]


def glances(contents: Contents) -> list[Glance]:
    """The best methods at each of MEASURES that has a value."""
    found = []
    for title, metric in MEASURES.items():
        won = [winner(contents, case, metric) for case in contents.cases]
        counts = Counter(name for one in won if one for name in one.names)
        if not counts:
            continue
        (_, most), *_ = counts.most_common(1)
        names = tuple(name for name in counts if counts[name] == most)
        after = [name for name, count in counts.most_common() if count < most][:1]
        ours = [label.short for label in contents.methods if label.method == "parapoint"]
        if not {*names, *after}.intersection(ours):
            after += sorted(ours, key=lambda name: -counts[name])[:1]
        of = sum(one is not None for one in won)
        behind = tuple(f"{name} on {counts[name]}" for name in after)
        found.append(Glance(title, metric, names, most, of, behind))
    return found


def page_of(contents: Contents, case: str) -> str:
    """Address of a model's page, from the index."""
    return f"models/{slug(contents.suite)}/{slug(case)}.html"


def definition(name: str) -> str:
    """What a metric is and where it comes from; "" for other columns."""
    if name in TIMES:
        return TIME_DEFINITIONS[name]
    metric = METRICS.get(name)
    if metric is None:
        return ""
    ideal = "" if metric.ideal is None else f"; ideal {metric.ideal:g}"
    return (
        f"{metric.heading}; {metric.better} is better{ideal}; "
        f"weighting: {metric.weighting}; source: {metric.source}"
    )


TIME_DEFINITIONS = {
    "seconds": "wall time of the parameterization alone, in seconds",
    "cpu_seconds": (
        "processor time of the parameterization alone, over all threads, in seconds; other "
        "programs on the machine hardly change it"
    ),
}
