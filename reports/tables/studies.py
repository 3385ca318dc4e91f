"""Tables for one question each: does it work where, does the cut, the seed, the variant matter?"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import stats

from benchmarks.metrics.grades import BOUNDS
from parapoint.surfaces.preparation import CUT
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
    number,
)
from reports.tables.notes import environment_note, failure_notes, legend, method_notes
from reports.tables.published import model
from reports.tables.table import Column, Table, Value, metric_column

Floats = npt.NDArray[np.float64]

OVERLAPPED, BIJECTIVE = "overlapped_fraction", "bijective"

CONFIDENCE = 0.95


def kind(contents: Contents, case: str) -> str:
    """What sort of surface a model is: its topology, or where it is from if that matters more."""
    entry = model(case)
    if entry is not None and entry.set in {"wild", "scans"}:
        return {"wild": "defective", "scans": "scans"}[entry.set]
    mesh = None if entry else contents.mesh(case)
    topology = entry.topology if entry else mesh.topology if mesh else "not at hand"
    known = {"disk": "disk", "sphere": "closed, genus 0"}
    if topology.endswith("no boundary"):
        return "closed, handles"
    if topology.startswith("genus"):
        return "open, holes"
    return known.get(topology, topology)


def kinds(contents: Contents) -> dict[str, list[str]]:
    """The models by the kind of surface."""
    found: dict[str, list[str]] = {}
    for case in contents.cases:
        found.setdefault(kind(contents, case), []).append(case)
    return found


def success(contents: Contents) -> Table:
    """Methods × kinds of surface: how often each ends well, and with a map that is one to one."""
    groups = {"all": contents.cases} | kinds(contents)
    if len(groups) == 2:  # one kind, which is all
        del groups["all"]
    rows = []
    for label in contents.methods:
        row: dict[str, Value] = {"method": label.short, "label": label.short}
        for name, cases in groups.items():
            records = [contents.records.get((case, label.short)) for case in cases]
            own = [record for record in records if record is not None]
            row[f"{name} ok"] = _share(sum(record["ok"] > 0 for record in own), len(own))
            bijective = sum(number(record, BIJECTIVE) == 1 for record in own)
            row[f"{name} {BIJECTIVE}"] = _share(bijective, len(own))
            usable = sum(record["grade"] == "usable" for record in own)
            row[f"{name} usable"] = _share(usable, len(own))
        rows.append(row)
    columns = [Column("method", "Method", text=True)]
    for name, cases in groups.items():
        columns.append(Column(f"{name} usable", "usable", text=True, group=f"{name}: {len(cases)}"))
        columns.append(Column(f"{name} ok", "ok", text=True, group=f"{name}: {len(cases)}"))
        if not contents.clouds.issuperset(cases):
            one = Column(f"{name} {BIJECTIVE}", "1 to 1", text=True, group=f"{name}: {len(cases)}")
            columns.append(one)
    return Table(
        name="success",
        title="Success by kind of surface",
        caption=(
            "By kind of surface (number of models): how many maps are usable, which alone is a "
            "success; on how many models the method ended well with "
            "at least one seed, and on how many of them its maps are one to one (no face flipped, "
            "degenerate or over another); of those it was asked for, skipped ones included."
        ),
        columns=tuple(columns),
        blocks=(tuple(rows),),
        notes=(
            f"Grades: {BOUNDS}.",
            legend(contents),
            *failure_notes(contents),
            environment_note(contents),
        ),
    )


def _share(count: int, of: int) -> str:
    return f"{count}/{of}" if of else "not run"


KIND_METRICS = (
    *(ANGLE, AREA, ISOMETRIC, FLIPPED, OVERLAPPED),
    *(POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS),
    "seconds",
)
"""The metrics that are told kind by kind."""


def means_by_kind(contents: Contents) -> Table:
    """Kinds of surface × methods: means over the models that all methods can do."""
    names = [name for name in KIND_METRICS if contents.means[name].notna().any()]
    blocks = []
    for name, cases in kinds(contents).items():
        common = common_cases(contents, cases)
        block = []
        for label in contents.methods:
            found = {case: contents.records.get((case, label.short)) for case in cases}
            own = [record for record in found.values() if record is not None]
            row: dict[str, Value] = {
                "kind": f"{name}: means over {len(common)} of {len(cases)}",
                "method": label.short,
                "label": label.short,
                "done": _share(sum(record["ok"] > 0 for record in own), len(own)),
            }
            for metric in names:
                values = [number(found[case], metric) for case in common]
                known = [value for value in values if value is not None]
                if known and len(known) == len(common):
                    row[metric] = float(np.mean(known))
            block.append(row)
        blocks.append(tuple(block))
    return Table(
        name="kinds",
        title="Means by kind of surface",
        caption=(
            "Means over the models of a kind on which every method that ever ends well on this "
            "kind did, so that nobody gains by failing; ok: on how many the method ended well."
        ),
        columns=(
            Column("kind", "Surface", text=True, once=True),
            Column("method", "Method", text=True),
            *(metric_column(name, _SHORT.get(name, "")) for name in names),
            Column("done", "ok", text=True),
        ),
        blocks=tuple(blocks),
        set_apart=contents.atlases,
        notes=(legend(contents), *method_notes(contents), environment_note(contents)),
    )


def common_cases(contents: Contents, cases: Sequence[str]) -> list[str]:
    """Those of `cases` on which every method that ends well on any of them does."""
    good = {key for key, record in contents.records.items() if record["ok"] > 0}
    able = [
        label.short
        for label in contents.methods
        if any((case, label.short) in good for case in cases)
    ]
    return [case for case in cases if able and all((case, short) in good for short in able)]


def ablation(contents: Contents) -> Table | None:
    """Variants of one method, model by model; None where the suite has several methods."""
    if len(contents.methods) < 2 or len({label.method for label in contents.methods}) > 1:
        return None
    names = (ANGLE, AREA, ISOMETRIC, FLIPPED, OVERLAPPED, SPANNING, "seam_length", "seconds")
    return Table(
        name="ablation",
        title=f"Ablation of {contents.methods[0].name}",
        caption=(
            "One change at a time: each variant on each model, over all faces, means over the "
            "seeds that ended well. Low distortion with many overlapped or flipped faces is no map."
        ),
        columns=(
            Column("case", "Model", text=True, once=True),
            Column("method", "Variant", text=True),
            *(metric_column(name, _SHORT.get(name, "")) for name in names),
            Column("done", "ok", text=True),
        ),
        blocks=tuple(_block(contents, case, names) for case in contents.cases),
        notes=(legend(contents), *failure_notes(contents), environment_note(contents)),
    )


_SHORT = {
    ANGLE: "angle [rad]",
    AREA: "area [0–2]",
    ISOMETRIC: "sym. Dirichlet",
    FLIPPED: "flipped %",
    OVERLAPPED: "overlapped %",
    SPANNING: "spanning %",
    POINT_ANGLE: "stretch",
    POINT_AREA: "area",
    POINT_COLLISIONS: "collisions %",
    POINT_TEARS: "tears %",
    "seam_excess": "seam − artist's",
}


def _block(contents: Contents, case: str, names: Sequence[str]) -> tuple[Mapping[str, Value], ...]:
    """The rows of a model, one a method: `names` and how many seeds ended well."""
    rows = []
    for label in contents.methods:
        record = contents.records.get((case, label.short))
        if record is None:
            continue
        done = f"{record['ok']}/{record['tried']}" if record["tried"] else "skipped"
        rows.append(
            {
                "case": case,
                "method": label.short,
                "label": label.short,
                "done": done,
                **{name: number(record, name) for name in names},
            }
        )
    return tuple(rows)


def cuts(contents: Contents) -> Table | None:
    """What each way of cutting costs and buys, model by model; None where nothing is cut."""
    if all(_cut(record) in {"", "none"} for record in contents.records.values()):
        return None
    lengths = ("chart_count", "seam_length", "seam_excess", SPANNING)
    wanted = (*lengths, ANGLE, AREA, ISOMETRIC, OVERLAPPED)
    names = [name for name in wanted if name in contents.metrics]
    blocks = []
    for case in contents.cases:
        block = []
        for row in _block(contents, case, names):
            record = contents.records[case, str(row["label"])]
            share = number(record, BIJECTIVE)
            bijective = "" if share is None else {0.0: "no", 1.0: "yes"}.get(share, f"{share:.0%}")
            block.append({**row, "cut": _cut(record), BIJECTIVE: bijective})
        blocks.append(tuple(block))
    return Table(
        name="cuts",
        title="Cuts and what they buy",
        caption=(
            "A longer seam and more charts buy less distortion: where each method cuts, how long "
            "(over the root of the surface's area; against the artist's, where there is one), and "
            "what the map is then worth. A learned seam that faces span has no length: their share "
            "stands in its place. Bijective: no flip, no overlap, no degenerate face; with "
            "several seeds, the share of them."
        ),
        columns=(
            Column("case", "Model", text=True, once=True),
            Column("method", "Method", text=True),
            Column("cut", "Cut", text=True),
            *(metric_column(name, _SHORT.get(name, "")) for name in names),
            Column(BIJECTIVE, "bijective", text=True),
            Column("done", "ok", text=True),
        ),
        blocks=tuple(blocks),
        set_apart=contents.atlases.union(lengths),
        notes=(*method_notes(contents), *failure_notes(contents), environment_note(contents)),
    )


def _cut(record: Mapping[str, object]) -> str:
    """How a model was cut for, or by, a method."""
    if not record["ok"]:
        return ""
    if (number(record, SPANNING) or 0) > 0:
        return "learned"
    if CUT in str(record["preprocessing"]):
        return "automatic"
    return "its own" if (number(record, "seam_length") or 0) > 0 else "none"


class Pair(NamedTuple):
    """Two methods on the models on which both ended well.

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
    able = [label for label in contents.methods if label.short not in contents.atlases]
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
            "Every two methods on the models on which both ended well (means over seeds): median "
            "difference, on how many models the first is lower, and the p-value of Wilcoxon's "
            f"signed-rank test, two-sided, corrected for the {len(pairs)} pairs (Holm). Failures "
            "do not enter: read it with the table of successes."
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
    """Two methods by one metric."""
    found = [
        (a, b)
        for case in contents.cases
        if (a := number(contents.records.get((case, one.short)), metric)) is not None
        and (b := number(contents.records.get((case, two.short)), metric)) is not None
        and math.isfinite(a)
        and math.isfinite(b)
    ]
    first, second = np.array(found, dtype=np.float64).reshape(-1, 2).T
    return pair(first, second)


def half_width(values: Floats) -> float:
    """Half of the confidence interval of the mean of (n,) values (Student 1908); NaN for one."""
    if len(values) < 2:
        return math.nan
    spread = float(np.std(values, ddof=1) / math.sqrt(len(values)))
    return spread * float(stats.t.ppf((1 + CONFIDENCE) / 2, len(values) - 1))


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
        Column("case", "Model", text=True, once=True),
        Column("method", "Method", text=True),
        Column("done", "ok", text=True),
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
            "(Student's t over the seeds that ended well), lowest and highest value. A method with "
            "one map for all seeds is deterministic there."
        ),
        columns=tuple(columns),
        blocks=tuple(blocks),
        notes=(*failure_notes(contents), environment_note(contents)),
    )
