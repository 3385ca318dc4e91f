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
    BIJECTIVE,
    FLIPPED,
    ISOMETRIC,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
    Contents,
    Label,
    number,
)
from reports.means import STATISTICS, common_cases, common_values, own_values, statistic
from reports.pictures.names import slug
from reports.ranking import TIMES, Mark, marks, may_rank, means_may_rank, ranks
from reports.tables.table import Column, metric_column

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

Entry = tuple[str, float | str | None, Mark]
"""What the page shows of a metric: the value as printed, the value to sort by, and its mark."""


def data(suites: Sequence[Contents]) -> dict[str, object]:
    """All that the leaderboard of the page shows, printed and ranked: it only picks and sorts.

    By suite: the means of the methods by statistic and by "common" or "own" models, their maps
    model by model, and every cell.
    """
    names = [
        name
        for name in (*METRICS, *TIMES)
        if name in TIMES or any(name in contents.metrics for contents in suites)
    ]
    return {
        "metrics": [_about(name) for name in names],
        "shown": [name for name in SHOWN if name in names],
        "suites": [_suite(contents, names) for contents in suites],
    }


def _about(name: str) -> dict[str, object]:
    return {
        "name": name,
        "title": metric_column(name).title,
        "head": metric_column(name).head.replace(" ↓", "\u00a0↓").replace(" ↑", "\u00a0↑"),
        "group": "cost" if name in TIMES else GROUPS[METRICS[name].group],
        "definition": definition(name),
    }


def _suite(contents: Contents, names: Sequence[str]) -> dict[str, object]:
    by_id = contents.measured.set_index("id").to_dict("index")
    return {
        "name": contents.suite,
        "methods": [_method(contents, label) for label in contents.methods],
        "models": [
            {"name": case, "page": page_of(contents, case), "maps": _maps(contents, case, names)}
            for case in contents.cases
        ],
        "common": len(common_cases(contents, contents.cases)),
        "summaries": {
            name: {
                over: _columns([_summary(contents, metric, name, over) for metric in names])
                for over in ("common", "own")
            }
            for name in STATISTICS
        },
        "cells": [
            {
                "model": contents.cases.index(row.case),
                "method": contents.methods.index(contents.labels[row.id]),
                "seed": row.seed,
                "status": row.status.replace("_", " "),
                "reason": row.reason,
                "entries": [
                    _entry(metric_column(name), _value(by_id[row.id], name)) for name in names
                ],
            }
            for row in contents.rows
        ],
    }


def _method(contents: Contents, label: Label) -> dict[str, object]:
    """What the page says of a method beside its metrics: how its cells ended, and why."""
    rows = [row for row in contents.rows if contents.labels[row.id] == label]
    bad = [row for row in rows if row.status != "ok"]
    counts = Counter(row.status.replace("_", " ") for row in bad)
    atlas = label.short in contents.atlases
    return {
        "name": label.short,
        "detail": "many charts, not ranked" if atlas else label.detail,
        "ok": f"{len(rows) - len(bad)}/{len(rows)}",
        "share": (len(rows) - len(bad)) / len(rows),
        "bad": ", ".join(f"{count} {status}" for status, count in counts.items()),
        "reasons": "\n".join(
            f"{row.case}: {row.status.replace('_', ' ')}, {row.reason or 'no reason given'}"
            for row in bad
        ),
    }


def _summary(contents: Contents, metric: str, name: str, over: str) -> list[Entry]:
    """The entries of all methods for a statistic of a metric, over "common" or "own" models."""
    column = metric_column(metric)
    common = common_cases(contents, contents.cases, metric)
    values, fit = [], []
    for label in contents.methods:
        own = (
            own_values(contents, label, metric)
            if over == "own"
            else common_values(contents, label, metric, common)
        )
        records = [contents.records.get((case, label.short)) for case in contents.cases]
        grades = [record["grade"] for record in records if record and record["ok"]]
        values.append(statistic(name, own, column.better))
        fit.append(
            label.short not in contents.atlases and means_may_rank(grades, angles=column.angles)
        )
    return _marked(column, values, fit)


def _maps(contents: Contents, case: str, names: Sequence[str]) -> list[dict[str, object] | None]:
    """What the page says of each method on a model; None where the method has no cell."""
    records = [contents.records.get((case, label.short)) for label in contents.methods]
    columns = []
    for metric in names:
        column = metric_column(metric)
        fit = [
            label.short not in contents.atlases
            and record is not None
            and may_rank(record["grade"], angles=column.angles)
            for label, record in zip(contents.methods, records, strict=True)
        ]
        columns.append(_marked(column, [number(record, metric) for record in records], fit))
    return [
        record
        and {
            "status": str(record["status"]).replace("_", " "),
            "reason": record["reason"],
            "grade": record["grade"],
            "entries": entries,
        }
        for record, entries in zip(records, _columns(columns), strict=True)
    ]


def _marked(column: Column, values: Sequence[float | None], fit: Sequence[bool]) -> list[Entry]:
    """Values of a metric printed, and marked where they are `fit` to be ranked."""
    texts = [column.shown(value) for value in values]
    ranked = [value if good else None for value, good in zip(values, fit, strict=True)]
    found = marks(ranked, texts, column.better, column.tie)
    return [_entry(column, value, mark) for value, mark in zip(values, found, strict=True)]


def _entry(column: Column, value: float | None, mark: Mark = "") -> Entry:
    """An entry whose value is one that JSON can hold, to five digits."""
    if value is None or math.isnan(value):
        return column.shown(None), None, mark
    return column.shown(value), float(f"{value:.5g}") if math.isfinite(value) else str(value), mark


def _value(values: Mapping[Any, object], name: str) -> float | None:
    return number({str(key): value for key, value in values.items()}, name)


def _columns(rows: Sequence[list[Entry]]) -> list[list[Entry]]:
    """Rows as columns."""
    return [list(column) for column in zip(*rows, strict=True)]
