"""What the page says at first sight: who is best at what, on what; and the cells behind it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from benchmarks.metrics.metric import GROUPS
from benchmarks.metrics.table import METRICS
from reports.contents import (
    ANGLE,
    AREA,
    FLIPPED,
    ISOMETRIC,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
    Contents,
    Label,
)
from reports.pictures.names import slug
from reports.ranking import is_of_angles, may_rank
from reports.tables.table import metric_column

MEASURES = {
    "Angles": ANGLE,
    "Areas": AREA,
    "Angles and areas": ISOMETRIC,
    "One to one": "bijective",
    "Angles at points": POINT_ANGLE,
    "Areas at points": POINT_AREA,
    "Speed": "seconds",
}
"""What the methods are compared by at first sight, and the metric that stands for it."""

SHOWN = (
    *(ANGLE, AREA, ISOMETRIC, FLIPPED, "overlapped_fraction", SPANNING),
    *(POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS),
    "seconds",
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

    Maps whose grade is too low for that (`reports.ranking`) take no part. Equal is what is equal
    to three digits.
    """
    column = metric_column(metric)
    values = {
        str(record["label"]): float(record[metric])
        for record in _by_case(contents).get(case, ())
        if math.isfinite(record[metric]) and may_rank(record["grade"], angles=is_of_angles(metric))
    }
    if not values or (metric == "bijective" and max(values.values()) < 1):
        return None
    best = (max if column.better == "higher" else min)(values.values())
    names = tuple(name for name, value in values.items() if f"{value:.2e}" == f"{best:.2e}")
    if metric == "bijective":
        return Winner(names, "")
    return Winner(names, column.shown(best) + (" s" if metric == "seconds" else ""))


@cache
def _by_case(contents: Contents) -> dict[str, list[dict[str, Any]]]:
    """The rows of `contents.means` with a map of one chart, model by model."""
    means = contents.means
    rivals = means[(means["ok"] > 0) & ~means["label"].isin(contents.atlases)]
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
    if name == "seconds":
        return "wall time of the parameterization alone, in seconds"
    metric = METRICS.get(name)
    if metric is None:
        return ""
    ideal = "" if metric.ideal is None else f"; ideal {metric.ideal:g}"
    return (
        f"{metric.heading}; {metric.better} is better{ideal}; "
        f"weighting: {metric.weighting}; source: {metric.source}"
    )


def data(suites: Sequence[Contents]) -> dict[str, object]:
    """All cells with all metrics, as the leaderboard of the page reads them."""
    names = [
        name
        for name in (*METRICS, "seconds")
        if name == "seconds" or any(name in contents.metrics for contents in suites)
    ]
    return {
        "metrics": [_about(name) for name in names],
        "shown": [name for name in SHOWN if name in names],
        "suites": [_suite(contents, names) for contents in suites],
    }


def _about(name: str) -> dict[str, object]:
    column = metric_column(name)
    return {
        "name": name,
        "title": column.title,
        "group": "cost" if name == "seconds" else GROUPS[METRICS[name].group],
        "better": column.better or "lower",
        "digits": column.digits,
        "percent": column.percent,
        "angles": column.angles,
        "definition": definition(name),
    }


def _suite(contents: Contents, names: Sequence[str]) -> dict[str, object]:
    by_id = contents.measured.set_index("id").to_dict("index")
    return {
        "name": contents.suite,
        "methods": [_method(contents, label) for label in contents.methods],
        "models": [{"name": case, "page": page_of(contents, case)} for case in contents.cases],
        "cells": [
            {
                "model": contents.cases.index(row.case),
                "method": contents.methods.index(contents.labels[row.id]),
                "seed": row.seed,
                "status": row.status.replace("_", " "),
                "reason": row.reason,
                "grade": by_id[row.id]["grade"] or "",
                "values": [_number(by_id[row.id], name) for name in names],
            }
            for row in contents.rows
        ],
    }


def _method(contents: Contents, label: Label) -> dict[str, object]:
    return {"name": label.short, "detail": label.detail, "atlas": label.short in contents.atlases}


def _number(values: Mapping[object, object], name: str) -> float | str | None:
    """A value as JSON can hold it, to five digits."""
    value = values.get(name)
    if not isinstance(value, int | float) or math.isnan(value):
        return None
    return float(f"{value:.5g}") if math.isfinite(value) else str(value)
