"""What chance may have done: paired tests of two methods, and what the seed changes."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from reports.contents import ANGLE, AREA, Contents, number
from reports.labels import Label
from reports.ranking import is_of_angles, may_rank
from reports.tables.notes import environment_note, failure_notes, method_notes
from reports.tables.table import CASE, DONE, METHOD, Column, Table, Value

Floats = npt.NDArray[np.float64]

CONFIDENCE = 0.95


class Pair(NamedTuple):
    """Two methods on the models on which both gave a map that may be ranked.

    Attributes:
        models: how many.
        difference: median of first minus second.
        wins: on how many models the first is lower.
        p: two-sided, of Wilcoxon's signed-rank test; NaN where it cannot be had.
    """

    models: int
    difference: float
    wins: int
    p: float


def pair(first: Floats, second: Floats) -> Pair:
    """(n,) values of two methods on the same models, compared model by model (Wilcoxon 1945)."""
    difference = first - second
    if not (difference != 0).any():
        return Pair(len(first), 0.0 if len(first) else math.nan, 0, math.nan)
    few = len(difference) <= 12
    p = signed_rank_p(difference) if few else float(stats.wilcoxon(difference).pvalue)
    return Pair(len(first), float(np.median(difference)), int((difference < 0).sum()), p)


def signed_rank_p(difference: Floats) -> float:
    """Two-sided p of the signed-rank test of (n,) differences, over all 2^n sign patterns.

    Exact with ties and zeros, too. As scipy's permutations, which refuse a single value.
    """
    known = difference[difference != 0]
    ranks = stats.rankdata(np.abs(known))
    sums = ranks @ np.indices((2,) * len(known)).reshape(len(known), -1)
    sum_here = ranks[known > 0].sum()
    return float(min(1, 2 * min((sums <= sum_here).mean(), (sums >= sum_here).mean())))


def holm(values: Floats) -> Floats:
    """(m,) p-values corrected for m tests (Holm 1979); NaN stays and does not count."""
    known = np.flatnonzero(~np.isnan(values))
    order = known[np.argsort(values[known])]
    corrected = np.full(len(values), np.nan)
    factors = np.arange(len(order), 0, -1)
    corrected[order] = np.minimum(np.maximum.accumulate(factors * values[order]), 1)
    return corrected


def paired_tests(contents: Contents) -> Table | None:
    """Every two methods with one chart, over the models both can do; None without five of them."""
    able = [label for label in contents.methods if label.short not in contents.unranked]
    pairs = list(itertools.combinations(able, 2))
    tests = {
        metric: [_pair(contents, one, two, metric) for one, two in pairs]
        for metric in (ANGLE, AREA)
    }
    most = max((test.models for test in tests[ANGLE]), default=0)
    if most < 5:
        return None
    corrected = {
        metric: holm(np.array([test.p for test in found])) for metric, found in tests.items()
    }
    rows = []
    for at, (one, two) in enumerate(pairs):
        row: dict[str, Value] = {"first": one.short, "second": two.short}
        row["models"] = float(tests[ANGLE][at].models)
        for metric, found in tests.items():
            test = found[at]
            row[f"{metric} difference"] = test.difference
            row[f"{metric} wins"] = f"{test.wins}/{test.models}"
            row[f"{metric} p"] = float(corrected[metric][at])
        rows.append(row)
    columns = [
        Column("first", "First", text=True),
        Column("second", "Second", text=True),
        Column("models", "models", digits=0),
    ]
    for metric, title in ((ANGLE, "Angle difference [rad]"), (AREA, "Area discrepancy [0–2]")):
        columns += [
            Column(f"{metric} difference", "median of first − second", digits=4, group=title),
            Column(f"{metric} wins", "first lower", text=True, group=title),
            Column(f"{metric} p", "p", group=title),
        ]
    return Table(
        name="paired",
        title="Two methods at a time",
        caption=(
            "Every two methods on the models on which both gave a map that may be ranked, by means "
            "over seeds: the median difference, how often the first is lower, and the two-sided "
            f"p-value of Wilcoxon's signed-rank test, corrected for the {len(pairs)} pairs (Holm). "
            "Failures and broken maps do not count here, nor collapsed ones by areas; the table of "
            "successes has them. The number of models is that by angles."
        ),
        columns=tuple(columns),
        blocks=(tuple(rows),),
        notes=(
            f"With {most} models no p-value is below {2.0 ** (1 - most):.2g} before correction.",
            *method_notes(contents),
            environment_note(contents),
        ),
    )


def _pair(contents: Contents, one: Label, two: Label, metric: str) -> Pair:
    """Two methods by one metric, on the models where the maps of both may be ranked by it."""
    found = [
        (a, b)
        for case in contents.cases
        if (a := _rankable(contents.records.get((case, one.short)), metric)) is not None
        and (b := _rankable(contents.records.get((case, two.short)), metric)) is not None
    ]
    first, second = np.array(found, dtype=np.float64).reshape(-1, 2).T
    return pair(first, second)


def _rankable(record: Mapping[str, Any] | None, metric: str) -> float | None:
    """The finite value of a metric in a record; None where there is none, or it has no rank."""
    value = number(record, metric)
    if record is None or value is None or not math.isfinite(value):
        return None
    return value if may_rank(record["grade"], angles=is_of_angles(metric)) else None


def half_width(values: Floats) -> float:
    """Half of the confidence interval of the mean of (n,) values (Student 1908); NaN for one."""
    if len(values) < 2:
        return math.nan
    return quantile(len(values)) * float(np.std(values, ddof=1) / math.sqrt(len(values)))


def quantile(count: int) -> float:
    """What the standard error of a mean of so many values is multiplied by; NaN for one."""
    return float(stats.t.ppf((1 + CONFIDENCE) / 2, count - 1)) if count > 1 else math.nan


def seed_variance(contents: Contents) -> Table | None:
    """Mean and confidence interval over the seeds of each cell; None with one seed each."""
    names = ((ANGLE, "Angle difference [rad]", 4), (AREA, "Area discrepancy [0–2]", 3))
    blocks = []
    for case in contents.cases:
        block = []
        for label in contents.methods:
            rows = contents.cell(case, label)
            good = [row for row in rows if row.status == "ok"]
            if len(good) < 2:
                continue
            own = contents.measured[contents.measured["id"].isin([row.id for row in good])]
            row: dict[str, Value] = {
                "case": case,
                "method": label.short,
                "done": f"{len(good)}/{len(rows)}",
                "maps": float(len({row.uv_sha256 for row in good})),
            }
            for name in (ANGLE, AREA, "seconds"):
                values = own[name].to_numpy(dtype=np.float64)
                row |= {
                    f"{name} mean": float(values.mean()),
                    f"{name} half": half_width(values),
                    f"{name} low": float(values.min()),
                    f"{name} high": float(values.max()),
                }
            block.append(row)
        if block:
            blocks.append(tuple(block))
    if not blocks:
        return None
    columns = [
        CASE,
        METHOD,
        DONE,
        Column("maps", "different maps", digits=0),
    ]
    for name, title, digits in (*names, ("seconds", "Time [s]", 1)):
        columns += [
            Column(f"{name} mean", "mean", digits=digits, group=title),
            Column(f"{name} half", "± 95 %", digits=digits, group=title),
            Column(f"{name} low", "lowest", digits=digits, group=title),
            Column(f"{name} high", "highest", digits=digits, group=title),
        ]
    return Table(
        name="seeds",
        title="What the seed changes",
        caption=(
            "Over the seeds of each cell: mean, half of the 95 % confidence interval of the mean "
            "(Student's t over the seeds that gave a map), lowest and highest value. A method with "
            "one map for all seeds is deterministic there."
        ),
        columns=tuple(columns),
        blocks=tuple(blocks),
        notes=(*failure_notes(contents), environment_note(contents)),
    )
