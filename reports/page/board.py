"""The leaderboard of the page: all is printed and ranked here; the page picks and sorts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from benchmarks.metrics.metric import GROUPS
from benchmarks.metrics.table import METRICS
from reports.contents import (
    Contents,
    number,
)
from reports.labels import Label
from reports.means import STATISTICS, common_cases, common_values, own_values, statistic
from reports.ranking import TIMES, Mark, flagged, marks, may_rank, means_may_rank
from reports.tables.leaderboard import SHOWN, definition, page_of
from reports.tables.overall import COUNTED, CRITERIA, halves
from reports.tables.statistics import quantile
from reports.tables.table import Column, metric_column

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
        "criteria": list(CRITERIA),
        "counted": list(COUNTED),
        "quantiles": [
            quantile(count) if count > 1 else None
            for count in range(1 + max(len(contents.cases) for contents in suites))
        ],
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
        "won": {name: _digits(contents, name) for name in CRITERIA},
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


def _digits(contents: Contents, criterion: str) -> list[str]:
    """For each model a digit for each pair, method by method: how it ends for the first, in halves.

    Only pairs of methods with one chart, or of those with many, are compared on the page.
    """
    return ["".join(map(str, model.ravel())) for model in halves(contents, criterion)]


def _method(contents: Contents, label: Label) -> dict[str, object]:
    """What the page says of a method beside its metrics: how its cells ended, and why."""
    rows = [row for row in contents.rows if contents.labels[row.id] == label]
    bad = [row for row in rows if row.status != "ok"]
    counts = Counter(row.status.replace("_", " ") for row in bad)
    atlas = label.short in contents.atlases
    detail = "many charts, not ranked" if atlas else label.detail
    if label.short in contents.partial:
        detail = "a part of the surface, not ranked"
    return {
        "name": label.short,
        "detail": detail,
        "charts": "many" if atlas else "one",
        "input": label.input,
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
            label.short not in contents.unranked and means_may_rank(grades, angles=column.angles)
        )
    return _marked(column, values, fit)


def _maps(contents: Contents, case: str, names: Sequence[str]) -> list[dict[str, object] | None]:
    """What the page says of each method on a model; None where the method has no cell."""
    records = [contents.records.get((case, label.short)) for label in contents.methods]
    columns = []
    for metric in names:
        column = metric_column(metric)
        fit = [
            label.short not in contents.unranked
            and record is not None
            and may_rank(record["grade"], angles=column.angles)
            for label, record in zip(contents.methods, records, strict=True)
        ]
        columns.append(_marked(column, [number(record, metric) for record in records], fit))
    for column, entries in zip(map(metric_column, names), columns, strict=True):
        for at, (record, (text, value, mark)) in enumerate(zip(records, entries, strict=True)):
            if record is not None and value is not None:
                entries[at] = (flagged(text, record["grade"], angles=column.angles), value, mark)
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
