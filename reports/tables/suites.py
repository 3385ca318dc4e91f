"""The tables of a suite: what each says."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.metrics.grades import BOUNDS
from parapoint.surfaces.preparation import CUT
from reports.contents import (
    ANGLE,
    AREA,
    FLIPPED,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
    WORST_PART,
    Contents,
    number,
)
from reports.means import STATISTICS, common_cases, common_values, own_values, statistic
from reports.ranking import MOST_LEFT_OUT, TIMES, may_rank, means_may_rank
from reports.tables.bakes import bakes
from reports.tables.kinds import means_by_kind, success
from reports.tables.methods import methods
from reports.tables.notes import (
    environment_note,
    failure_notes,
    grade_notes,
    legend,
    load_notes,
    method_notes,
)
from reports.tables.overall import overall
from reports.tables.published import (
    AUTHORS,
    Verdict,
    claim_reason,
    claim_text,
    published_values,
    verdicts,
)
from reports.tables.statistics import paired_tests, seed_variance
from reports.tables.table import (
    CASE,
    DONE,
    METHOD,
    Column,
    Table,
    Value,
    metric_column,
    metric_title,
)
from reports.tables.variants import ablation, cuts

SUMMARY_METRICS = (
    ANGLE,
    f"{ANGLE}_without_spanning",
    "quasi_conformal_mean",
    AREA,
    f"{AREA}_without_spanning",
    "area_log_ratio_mean",
    "symmetric_dirichlet",
    FLIPPED,
    "overlapped_fraction",
    SPANNING,
    "seam_length",
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    *TIMES,
)
"""The metrics of the comparison, in print and as CSV; `everything` has all, cell by cell."""


def conformality(contents: Contents) -> Table | None:
    """The supplement's table: models × methods, published figures in columns of their own.

    None where all models are clouds, which have no triangles.
    """
    if contents.clouds.issuperset(contents.cases):
        return None
    columns = [Column("case", "Model", text=True)]
    columns += [
        metric_column(ANGLE, label.short, key=label.short, group="Measured here")
        for label in contents.methods
    ]
    authors = [
        author
        for author in AUTHORS
        if any(author in published_values(case) for case in contents.cases)
    ]
    columns += [
        Column(f"published {author}", author, digits=3, group="Published, other files")
        for author in authors
    ]
    if authors:
        columns.append(Column("claim", "Our file is", text=True))
    rows: list[dict[str, Value]] = []
    for case in contents.cases:
        row: dict[str, Value] = {"case": case, "claim": claim_text(case)}
        for label in contents.methods:
            record = contents.records.get((case, label.short))
            value = number(record, ANGLE)
            status = str(record["status"]).replace("_", " ") if record else ""
            row[label.short] = value if value is not None else (status if status != "ok" else "")
            row[f"grade {label.short}"] = str(record["grade"] or "") if record else ""
        for author, value in published_values(case).items():
            row[f"published {author}"] = value
        rows.append(row)
    return Table(
        name="conformality",
        title="Conformality",
        caption=(
            "Conformality: mean absolute difference between the angles of the 3D and of the UV "
            "triangles, radians, over all corners, unweighted; lower is better, best in bold, "
            "second underlined. Alone it rewards maps that shrink most of the surface to nothing: "
            "read it with the area distortion and the flips of the full table."
        ),
        columns=tuple(columns),
        blocks=(tuple(rows),),
        across=True,
        set_apart=contents.unranked,
        notes=(
            legend(contents),
            *grade_notes(contents),
            *method_notes(contents),
            *_published_notes(authors),
            environment_note(contents),
        ),
    )


def _published_notes(authors: Sequence[str]) -> list[str]:
    if not authors:
        return []
    return [
        (
            "Published figures are those of the ParaPoint supplement (SLIM, ParaPoint) and of FAM, "
            "NeurIPS 2024 (FAM), on files that are not public; they are never ranked with ours."
        )
    ]


def supplement(contents: Contents) -> Table | None:
    """Each mesh's methods with angle distortion, area distortion, flips and spanning faces."""
    meshes = [case for case in contents.cases if case not in contents.clouds]
    if not meshes:
        return None
    judged: dict[tuple[str, str], Verdict] = {
        (verdict.case, verdict.label.short): verdict
        for verdict in verdicts(contents)
        if verdict.label is not None and verdict.figure.metric == ANGLE
    }
    without = f"{ANGLE}_without_spanning"
    area_without = f"{AREA}_without_spanning"
    columns = [
        CASE,
        METHOD,
        Column("grade", "Grade", text=True),
        metric_column(ANGLE, "all faces", group="Angle difference [rad]"),
        metric_column(without, "no spanning", group="Angle difference [rad]"),
        metric_column(AREA, "all faces", group="Area discrepancy [0–2]"),
        metric_column(area_without, "no spanning", group="Area discrepancy [0–2]"),
        metric_column(WORST_PART, "worst part", digits=2),
        metric_column(FLIPPED, "flipped %"),
        Column(SPANNING, "spanning %", digits=2, percent=True),
        Column("chart_count", "charts", digits=0),
        Column("seam_length", "seam", digits=2),
        metric_column("seconds", "wall", group="Time [s]"),
        metric_column("cpu_seconds", "processor", group="Time [s]"),
        DONE,
    ]
    authors = [
        author
        for author in AUTHORS
        if any(author in published_values(case) for case in contents.cases)
    ]
    columns += [
        Column(f"published {author}", author, once=True, group="Published, other files")
        for author in authors
    ]
    if authors:
        columns.append(Column("verdict", "Against published", text=True))
    blocks = []
    for case in meshes:
        rows: list[dict[str, Value]] = []
        for label in contents.methods:
            record = contents.records.get((case, label.short))
            if record is None:
                continue
            cut = " + automatic cut" if CUT in str(record["preprocessing"]) else ""
            row: dict[str, Value] = {
                "case": f"{case} ({claim_text(case)})" if authors else case,
                "method": label.text + cut,
                **{
                    name: number(record, name)
                    for name in (ANGLE, without, AREA, area_without, WORST_PART, FLIPPED)
                },
                "label": label.short,
                "grade": str(record["grade"] or ""),
                **{name: number(record, name) for name in (SPANNING, "chart_count", "seam_length")},
                **{name: number(record, name) for name in TIMES},
                "done": f"{record['ok']}/{record['tried']}" if record["tried"] else "skipped",
            }
            if record["status"] != "ok":
                row["done"] = str(record["status"]).replace("_", " ")
            for author, value in published_values(case).items():
                row[f"published {author}"] = value
            verdict = judged.get((case, label.short))
            row["verdict"] = verdict.text if verdict else ""
            rows.append(row)
        blocks.append(tuple(rows))
    return Table(
        name="supplement",
        title="Angle and area distortion, model by model",
        caption=(
            "Each model's maps. The angle difference is the paper's conformality: over all faces, "
            "as it was published, and without the faces that span a learned seam. So is the area "
            "discrepancy, which is 0 for an equal-area map and at most 2. The length of the seams "
            "is given over the square root of the surface's area. The last column counts the runs "
            "that gave a map, of those that were tried."
        ),
        columns=tuple(columns),
        blocks=tuple(blocks),
        set_apart=contents.unranked,
        notes=(
            f"Grades: {BOUNDS}.",
            *grade_notes(contents),
            *method_notes(contents),
            *_published_notes(authors),
            *failure_notes(contents),
            *load_notes(contents),
            environment_note(contents),
        ),
    )


def comparison(contents: Contents, names: Sequence[str] = ()) -> Table:
    """Methods × metrics: mean, median and worst over each method's own models, and common means.

    `names` are the metrics: SUMMARY_METRICS unless given. The common mean is over the models on
    which every method that ever succeeded did, so that nobody gains by failing.
    """
    blocks = []
    shared: dict[str, int] = {}
    for name in names or SUMMARY_METRICS:
        column = metric_column(name)
        common = common_cases(contents, contents.cases, name)
        rows: list[dict[str, Value]] = []
        for label in contents.methods:
            values = own_values(contents, label, name)
            records = [contents.records.get((case, label.short)) for case in contents.cases]
            own = [record for record in records if record is not None]
            grades = [record["grade"] for record in own if record["ok"]]
            rows.append(
                {
                    "metric": metric_title(name),
                    "name": name,
                    "method": label.short,
                    "label": label.short,
                    **{key: statistic(key, values, column.better) for key in STATISTICS},
                    "common": statistic(
                        "mean", common_values(contents, label, name, common), column.better
                    ),
                    "count": f"{len(values)}/{sum(record['tried'] > 0 for record in own)}",
                    "skipped": float(sum(record["skipped"] > 0 for record in own)),
                    "grade": "" if means_may_rank(grades, angles=column.angles) else "broken",
                    "invalid": float(
                        sum(not may_rank(one, angles=column.angles) for one in grades)
                    ),
                }
            )
        if any(row["mean"] is not None for row in rows):
            blocks.append(tuple(rows))
            shared[column.title] = len(common)
    common = common_cases(contents, contents.cases)
    shown = f"{len(common)}: {', '.join(common)}" if 0 < len(common) <= 12 else str(len(common))
    fewer = [f"{title} on {count}" for title, count in shared.items() if count != len(common)]
    return Table(
        name="comparison",
        title="All methods over all models",
        caption=(
            "Mean, median and worst value of each metric over the models on which the method gave "
            "a map, and their number; then the mean over the models on which every method gave one "
            f"({shown}). The arrow beside a metric points to its better side. A method is not "
            f"ranked where more than {MOST_LEFT_OUT:.0%} of its maps may not be."
        ),
        columns=(
            Column("metric", "Metric", text=True, once=True),
            METHOD,
            Column("mean", "mean", by_row=True),
            Column("median", "median", by_row=True),
            Column("worst", "worst", by_row=True),
            Column("common", "common mean", by_row=True),
            Column("count", "ok / tried", text=True),
            Column("invalid", "not rankable", digits=0),
            Column("skipped", "skipped", digits=0),
        ),
        blocks=tuple(blocks),
        set_apart=contents.unranked,
        notes=(
            *([f"Not defined on all models: {', '.join(fewer)}."] if fewer else []),
            *method_notes(contents),
            *failure_notes(contents),
            *load_notes(contents),
            environment_note(contents),
        ),
    )


def against_published(contents: Contents) -> Table | None:
    """Every published figure of the models with its verdict and why; None without any."""
    judged = verdicts(contents)
    if all(verdict.label is None for verdict in judged):
        return None
    blocks: dict[str, list[Mapping[str, Value]]] = {}
    for verdict in judged:
        figure, measured = verdict.figure, verdict.measured
        blocks.setdefault(verdict.case, []).append(
            {
                "case": f"{verdict.case} (paper: {figure.paper_name})",
                "claim": verdict.claim,
                "figure": f"{figure.method}, {figure.note}" if figure.note else figure.method,
                "method": verdict.label.text if verdict.label else "",
                "metric": f"{metric_column(figure.metric).title} [{figure.unit}]",
                "measured": measured,
                "published": figure.value,
                "tolerance": figure.tolerance,
                "verdict": verdict.word,
                "why": verdict.why,
            }
        )
    sources = {verdict.figure.source.rpartition(", ")[0]: verdict.figure for verdict in judged}
    return Table(
        name="published",
        title="Published against measured",
        caption=(
            "Each figure that a paper prints for one of the models, against what was measured "
            "here. Reproduced: within the tolerance. Better and worse: beyond it. A verdict is "
            "given only where our file is, or likely is, the authors' own model."
        ),
        columns=(
            CASE,
            Column("claim", "Our file is", text=True, once=True),
            Column("figure", "Published for", text=True),
            METHOD,
            Column("metric", "Metric", text=True),
            Column("measured", "measured", digits=4),
            Column("published", "published"),
            Column("tolerance", "tolerance"),
            Column("verdict", "Verdict", text=True),
            Column("why", "Why", text=True),
        ),
        blocks=tuple(tuple(rows) for rows in blocks.values()),
        notes=(
            *(f"{source}: {figure.trust}." for source, figure in sources.items()),
            *(f"{case}: {reason}" for case in blocks if (reason := claim_reason(case))),
            environment_note(contents),
        ),
    )


def failures(contents: Contents) -> Table | None:
    """Every cell that gave no map, with its reason; None where all gave one."""
    rows = [
        {
            "case": row.case,
            "method": contents.labels[row.id].text,
            "seed": float(row.seed),
            "status": row.status.replace("_", " "),
            "reason": row.reason or "no reason given",
            "seconds": row.seconds,
        }
        for row in contents.rows
        if row.status != "ok"
    ]
    if not rows:
        return None
    return Table(
        name="failures",
        title="Cells without a map",
        caption="A method skips a surface that it knows beforehand that it cannot take.",
        columns=(
            Column("case", "Model", text=True),
            METHOD,
            Column("seed", "seed", digits=0),
            Column("status", "status", text=True),
            Column("reason", "reason", text=True),
            Column("seconds", "time [s]", digits=1),
        ),
        blocks=(tuple(rows),),
    )


def everything(contents: Contents) -> Table:
    """One row a cell with every metric: the CSV for other programs."""
    names = [*TIMES, *contents.metrics]
    by_id = contents.measured.set_index("id").to_dict("index")
    rows = tuple(
        {
            "case": row.case,
            "method": contents.labels[row.id].text,
            "seed": float(row.seed),
            "status": row.status,
            **{name: number({str(k): v for k, v in by_id[row.id].items()}, name) for name in names},
        }
        for row in contents.rows
    )
    return Table(
        name="cells",
        title="Every cell",
        caption="Every metric of every cell.",
        columns=(
            Column("case", "Model", text=True),
            METHOD,
            Column("seed", "seed", digits=0),
            Column("status", "status", text=True),
            *(metric_column(name) for name in names),
        ),
        blocks=(rows,),
        notes=(environment_note(contents),),
    )


def tables(contents: Contents) -> list[Table]:
    """The tables of a suite, in the order in which to read them."""
    made = [
        ablation(contents),
        methods(contents),
        success(contents),
        overall(contents),
        means_by_kind(contents),
        conformality(contents),
        against_published(contents),
        supplement(contents),
        bakes(contents),
        comparison(contents),
        cuts(contents),
        paired_tests(contents),
        seed_variance(contents),
        failures(contents),
    ]
    return [table for table in made if table is not None]
