"""The tables of a comparison: what moved, what has another status, what is new."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from reports.history.comparison import (
    LEAST_SECONDS,
    ONE_SEED,
    ONE_TIME,
    ROUNDING,
    Comparison,
    Group,
    Key,
)
from reports.tables.table import Column, Table, Value, metric_column


def summary(found: Comparison) -> Table:
    """One row a suite and method: how many cells moved, which way, and the ratio of the times."""
    rows: dict[tuple[str, str, str], dict[str, Value]] = {}
    order = dict.fromkeys((key[0], key[2], key[3]) for key in found.shared)
    for suite, method, params in order:
        keys = [key for key in found.shared if (key[0], key[2], key[3]) == (suite, method, params)]
        moves = [move for move in found.moves if move.key in keys]
        pairs = [found.group(key) for key in keys]
        ratios = [
            float(new.values["seconds"].mean() / old.values["seconds"].mean())
            for old, new in pairs
            if len(old.values["seconds"]) and len(new.values["seconds"])
        ]
        worse = {move.key for move in moves if move.verdict == "worse"}
        better = {move.key for move in moves if move.verdict == "better"}
        rows[suite, method, params] = {
            "suite": suite,
            "method": pairs[0][1].short,
            "cells": float(len(keys)),
            "maps": float(sum(old.maps == new.maps for old, new in pairs)),
            "status": float(sum(old.status != new.status for old, new in pairs)),
            "better": float(len(better - worse)),
            "worse": float(len(worse - better)),
            "mixed": float(len(better & worse)),
            "seconds": float(np.exp(np.mean(np.log(ratios)))) if ratios else None,
        }
    comparable = "" if found.same_hardware else " (other hardware: not comparable)"
    blocks: dict[str, list[Mapping[str, Value]]] = {}
    for row in rows.values():
        blocks.setdefault(str(row["suite"]), []).append(row)
    return Table(
        name="summary",
        title="What moved",
        caption=(
            "Counts of the cells that are in both folders, all seeds of a cell as one: those with "
            "the very same maps, with another status, and those of which some metric moved "
            "beyond noise, for the better, for the worse or both ways. The time ratio is the time "
            "after over the time before (geometric mean)."
        ),
        columns=(
            Column("suite", "Suite", text=True, once=True),
            Column("method", "Method", text=True),
            Column("cells", "cells", digits=0),
            Column("maps", "same maps", digits=0),
            Column("status", "other status", digits=0),
            Column("better", "better", digits=0),
            Column("worse", "worse", digits=0),
            Column("mixed", "both ways", digits=0),
            Column("seconds", f"time ratio{comparable}", digits=2),
        ),
        blocks=tuple(tuple(block) for block in blocks.values()),
        notes=tuple(_notes(found)),
    )


def _notes(found: Comparison) -> Iterator[str]:
    """What the two folders are, and what holds for all tables."""
    before, after = found.names if all(found.names) else (found.before, found.after)
    yield f"Before: {before}. After: {after}."
    for name, (old, new) in found.machines.items():
        yield f"{name}: {old or 'none'} before, {new or 'none'} after."
    if not found.same_hardware:
        yield (
            "The hardware is not the same, or not known: the times are shown, and nothing is "
            "concluded from them."
        )
    yield (
        "Noise: for a deterministic method none, but on other hardware "
        f"{ROUNDING:g} of the value; with several seeds, the 95 % confidence interval "
        f"of the difference (Welch); with one seed, {ONE_SEED:.0%} of the value, and "
        f"{ONE_TIME:.0%} or {LEAST_SECONDS:g} s of the time."
    )
    changed = found.changed_maps()
    if changed:
        names = [f"{found.group(key)[1].short} on {key[1]}" for key in changed]
        yield f"Deterministic, and yet another map, if only in its last digits: {', '.join(names)}."


def _named(found: Comparison, key: Key, side: int = 1) -> dict[str, Value]:
    """Suite, model and method of a cell."""
    return {"suite": key[0], "case": key[1], "method": found.cells[side][key].short}


_NAMES = (
    Column("suite", "Suite", text=True),
    Column("case", "Model", text=True),
    Column("method", "Method", text=True),
)


def moved(found: Comparison) -> Table | None:
    """Every metric and time that moved beyond noise, cell by cell; None where none did."""
    blocks: dict[Key, list[Mapping[str, Value]]] = {}
    for move in [*found.moves, *found.times]:
        old, new = found.group(move.key)
        blocks.setdefault(move.key, []).append(
            {
                **_named(found, move.key),
                "metric": metric_column(move.name).title,
                "before": move.before,
                "after": move.after,
                "change": move.after - move.before,
                "noise": move.noise,
                "why": move.why,
                "changed": _changed(old, new),
                "verdict": move.verdict,
            }
        )
    if not blocks:
        return None
    return Table(
        name="moved",
        title="Beyond noise, cell by cell",
        caption=(
            "Every value that moved by more than its noise: means over the seeds that gave a map. "
            "Changed: the method's own source, or the surface it was given."
        ),
        columns=(
            *(replace(column, once=True) for column in _NAMES),
            Column("metric", "Metric", text=True),
            Column("before", "before", digits=4),
            Column("after", "after", digits=4),
            Column("change", "change", digits=4),
            Column("noise", "noise", digits=4),
            Column("why", "Noise from", text=True),
            Column("changed", "Changed", text=True),
            Column("verdict", "Verdict", text=True),
        ),
        blocks=tuple(tuple(rows) for rows in blocks.values()),
    )


def _changed(old: Group, new: Group) -> str:
    """What is not the same before a cell ran."""
    known = {"source": "source_hash", "surface": "surface_hash"}
    sides = [[getattr(row, name) for row in old.rows.values()] for name in known.values()]
    others = [[getattr(row, name) for row in new.rows.values()] for name in known.values()]
    pairs = zip(known, sides, others, strict=True)
    return ", ".join(name for name, one, two in pairs if set(one) != set(two)) or "nothing"


def by_metric(found: Comparison) -> Table | None:
    """For each metric that moved beyond noise, in how many cells and where most; None for none."""
    rows: list[Mapping[str, Value]] = []
    for name in dict.fromkeys(move.name for move in found.moves):
        own = [move for move in found.moves if move.name == name]
        finite = [move for move in own if math.isfinite(move.after - move.before)]
        most = max(finite, key=lambda move: abs(move.after - move.before), default=own[0])
        verdicts = [move.verdict for move in own]
        rows.append(
            {
                "metric": metric_column(name).title,
                "better": float(verdicts.count("better")),
                "worse": float(verdicts.count("worse")),
                "most": f"{found.group(most.key)[1].short} on {most.key[1]}",
                "before": most.before,
                "after": most.after,
            }
        )
    if not rows:
        return None
    return Table(
        name="metrics",
        title="What moved, metric by metric",
        caption=(
            f"Of {len(found.shared)} cells in both, those in which the metric moved by more than "
            "its noise, and the largest of these moves."
        ),
        columns=(
            Column("metric", "Metric", text=True),
            Column("better", "better", digits=0),
            Column("worse", "worse", digits=0),
            Column("most", "moved most", text=True),
            Column("before", "before", digits=4),
            Column("after", "after", digits=4),
        ),
        blocks=(tuple(rows),),
    )


def ended(found: Comparison) -> Table | None:
    """Cells with another status than before, and why; None where there are none."""
    rows = []
    for key in found.shared:
        old, new = found.group(key)
        if old.status != new.status:
            rows.append(
                {
                    **_named(found, key),
                    "before": old.status,
                    "after": new.status,
                    "reason": new.reason or old.reason,
                }
            )
    if not rows:
        return None
    return Table(
        name="ended",
        title="Another status",
        caption="The reason is the one after, or the one before where there is none after.",
        columns=(
            *_NAMES,
            Column("before", "before", text=True),
            Column("after", "after", text=True),
            Column("reason", "Reason", text=True),
        ),
        blocks=(tuple(rows),),
    )


def alone(found: Comparison) -> Table | None:
    """Cells in one folder alone; None where there are none."""
    rows = [
        {**_named(found, key, side), "where": ("before", "after")[side]}
        for side in (0, 1)
        for key in found.only(side)
    ]
    if not rows:
        return None
    return Table(
        name="alone",
        title="In one folder alone",
        caption="Cells that have nothing to be compared with.",
        columns=(*_NAMES, Column("where", "Only", text=True)),
        blocks=(tuple(rows),),
    )
