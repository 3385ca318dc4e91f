"""Tables: what they say, and how they are written as LaTeX, Markdown and CSV."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

from benchmarks.metrics import METRICS
from parapoint.preparation import CUT
from reports.contents import Contents
from reports.published import AUTHORS, Verdict, claim_text, published_values, verdicts

Value = float | str | None
Mark = Literal["", "best", "second"]

ARROWS = {"lower": "↓", "higher": "↑"}

ANGLE = "angle_difference_mean"
AREA = "area_discrepancy_total"
FLIPPED = "flipped_fraction"
SPANNING = "spanning_fraction"

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
    "seconds",
)
"""The metrics of the printed comparison; its CSV has them all."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        key: of the value in each row.
        title: the head.
        better: "lower" or "higher" where values are ranked, else "".
        digits: after the point.
        percent: whether values are fractions to be shown as per cent.
        once: whether the value is that of the whole block, printed in its first row.
        group: a head over neighbouring columns with the same group.
        text: whether it holds words, set to the left.
    """

    key: str
    title: str
    better: str = ""
    digits: int = 3
    percent: bool = False
    once: bool = False
    group: str = ""
    text: bool = False

    @property
    def head(self) -> str:
        """Title with the arrow to the better side."""
        return f"{self.title} {ARROWS[self.better]}" if self.better else self.title

    def shown(self, value: Value) -> str:
        """`value` as it is printed."""
        if value is None or isinstance(value, str):
            return value or ("" if self.text else "–")
        if math.isnan(value):
            return "–"
        if math.isinf(value):
            return "∞" if value > 0 else "−∞"
        number = 100 * value if self.percent else value
        if 0 < abs(number) < 0.5 * 10**-self.digits:
            return f"<{10**-self.digits:.{self.digits}f}"
        if abs(number) >= 1e5:
            mantissa, exponent = f"{number:.1e}".split("e")
            return f"{mantissa}·10^{int(exponent)}"
        return f"{number:,.{self.digits}f}".replace("-", "−")


class Cell(NamedTuple):
    """A printed value, its rank among those it is compared with, and the value itself."""

    text: str
    mark: Mark
    value: Value


@dataclass(frozen=True)
class Table:
    """A table, whatever it is written as.

    Attributes:
        name: of its files.
        title: one line.
        caption: what is in it and how to read it.
        columns: left to right.
        blocks: rows that belong together; values are ranked within a block.
        across: rank the values of a row among each other instead.
        notes: lines under the table.
        set_apart: values of "label" of rows, or keys of columns, that take no part in the ranking.
    """

    name: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    blocks: tuple[tuple[Mapping[str, Value], ...], ...]
    across: bool = False
    notes: tuple[str, ...] = ()
    set_apart: frozenset[str] = frozenset()

    @cached_property
    def cells(self) -> tuple[tuple[tuple[Cell, ...], ...], ...]:
        """Cells by block, row and column."""
        return tuple(self._block(block) for block in self.blocks)

    def _block(self, block: Sequence[Mapping[str, Value]]) -> tuple[tuple[Cell, ...], ...]:
        columns = self.columns
        texts = [[column.shown(row.get(column.key)) for column in columns] for row in block]
        marks: list[list[Mark]] = [["" for _ in columns] for _ in block]
        ranked = [
            at
            for at, column in enumerate(columns)
            if column.better and column.key not in self.set_apart
        ]
        rows = [at for at, row in enumerate(block) if row.get("label") not in self.set_apart]
        if self.across:
            groups = [[(r, c) for c in ranked] for r in rows]
        else:
            groups = [[(r, c) for r in rows] for c in ranked]
        for group in groups:
            _rank(group, block, columns, texts, marks)
        return tuple(
            tuple(
                Cell(texts[r][c], marks[r][c], row.get(column.key))
                for c, column in enumerate(columns)
            )
            for r, row in enumerate(block)
        )


def _rank(
    places: Sequence[tuple[int, int]],
    block: Sequence[Mapping[str, Value]],
    columns: Sequence[Column],
    texts: Sequence[Sequence[str]],
    marks: list[list[Mark]],
) -> None:
    """Mark the best and the second of the values at `places`; what prints alike ranks alike."""
    numbers: dict[tuple[int, int], float] = {}
    for row, column in places:
        value = block[row].get(columns[column].key)
        if isinstance(value, int | float) and math.isfinite(value):
            numbers[row, column] = value if columns[column].better == "lower" else -value
    order = list(dict.fromkeys(texts[r][c] for r, c in sorted(numbers, key=numbers.__getitem__)))
    if len(order) < 2:
        return
    for row, column in numbers:
        if texts[row][column] == order[0]:
            marks[row][column] = "best"
        elif texts[row][column] == order[1]:
            marks[row][column] = "second"


_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"$<$",
    ">": r"$>$",
    "|": r"$|$",
    "↓": r"$\downarrow$",
    "↑": r"$\uparrow$",
    "∞": r"$\infty$",
    "−": r"$-$",
    "–": "--",
    "±": r"$\pm$",
    "·": r"$\cdot$",
    "×": r"$\times$",
    "≤": r"$\leq$",
    "σ": r"$\sigma$",
    "“": "``",
    "”": "''",
}


def latex_text(text: str) -> str:
    """`text` with every character that LaTeX reads otherwise escaped; others outside ASCII as ?."""
    text = " ".join(text.split())
    pieces = re.split(r"(·10\^−?\d+)", text)
    return "".join(
        rf"$\cdot 10^{{{piece[4:].replace('−', '-')}}}$"
        if re.fullmatch(r"·10\^−?\d+", piece)
        else "".join(_LATEX.get(c, c if c.isascii() and c.isprintable() else "?") for c in piece)
        for piece in pieces
    )


def latex(table: Table) -> str:
    """The table as a LaTeX float; needs the packages booktabs and graphicx."""
    columns = table.columns
    lines = [
        "% needs \\usepackage{booktabs,graphicx}",
        r"\begin{table}[t]",
        r"\centering",
        rf"\caption{{{latex_text(table.caption)}}}",
        rf"\label{{tab:{table.name}}}",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        r"\begin{tabular}{" + "".join("l" if column.text else "r" for column in columns) + "}",
        r"\toprule",
    ]
    groups = grouped(columns)
    if any(name for name, _ in groups):
        heads, rules, at = [], [], 1
        for name, width in groups:
            heads.append(rf"\multicolumn{{{width}}}{{c}}{{{latex_text(name)}}}" if name else "")
            heads.extend([""] * (width - 1) if not name else [])
            if name:
                rules.append(rf"\cmidrule(lr){{{at}-{at + width - 1}}}")
            at += width
        lines += [" & ".join(heads) + r" \\", " ".join(rules)]
    lines.append(" & ".join(latex_text(column.head) for column in columns) + r" \\")
    for block in table.cells:
        lines.append(r"\midrule")
        for number, row in enumerate(block):
            cells = [
                "" if number and column.once else _latex_cell(cell)
                for column, cell in zip(columns, row, strict=True)
            ]
            lines.append(" & ".join(cells) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}}"]
    if table.notes:
        notes = r" \\ ".join(latex_text(note) for note in table.notes)
        lines.append(rf"\par\smallskip\parbox{{\linewidth}}{{\footnotesize {notes}}}")
    return "\n".join([*lines, r"\end{table}", ""])


def _latex_cell(cell: Cell) -> str:
    text = latex_text(cell.text)
    return {"best": rf"\textbf{{{text}}}", "second": rf"\underline{{{text}}}"}.get(cell.mark, text)


def grouped(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """The heads over the columns and how many columns each spans."""
    groups: list[tuple[str, int]] = []
    for column in columns:
        if groups and groups[-1][0] == column.group:
            groups[-1] = (column.group, groups[-1][1] + 1)
        else:
            groups.append((column.group, 1))
    return groups


def markdown(table: Table) -> str:
    """The table as Markdown; best in bold, second in italics."""

    def escaped(text: str) -> str:
        return re.sub(r"([\\`*_{}\[\]<>|#])", r"\\\1", " ".join(text.split()))

    heads = [
        f"{column.group}: {column.head}" if column.group else column.head
        for column in table.columns
    ]
    lines = [
        f"### {escaped(table.title)}",
        "",
        "| " + " | ".join(escaped(head) for head in heads) + " |",
        "|" + "|".join(":---" if column.text else "---:" for column in table.columns) + "|",
    ]
    around = {"best": "**", "second": "*", "": ""}
    for block in table.cells:
        for number, row in enumerate(block):
            cells = [
                ""
                if number and column.once
                else f"{around[cell.mark]}{escaped(cell.text)}{around[cell.mark]}"
                for column, cell in zip(table.columns, row, strict=True)
            ]
            lines.append("| " + " | ".join(cells) + " |")
    lines += ["", escaped(table.caption), ""]
    lines += [line for note in table.notes for line in (f"- {escaped(note)}",)]
    return "\n".join(lines).rstrip() + "\n"


def comma_separated(table: Table) -> str:
    """The table as CSV: keys as heads, numbers in full, every row complete."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([column.key for column in table.columns])
    for block in table.blocks:
        for row in block:
            values = [row.get(column.key) for column in table.columns]
            writer.writerow(["" if value is None else value for value in values])
    return out.getvalue()


def environment_note(contents: Contents) -> str:
    """Where the numbers come from: machine, commit, versions, seeds."""
    runs = contents.store.environment()["runs"]
    used = {row.run for row in contents.rows}
    said = []
    for number, run in enumerate(runs):
        if number not in used or not isinstance(run, Mapping):
            continue
        commit = str(run.get("commit") or "unknown")[:12]
        changed = " with local changes" if run.get("dirty") else ""
        said.append(
            f"commit {commit}{changed}, {run.get('cpu') or 'unknown processor'}, "
            f"{run.get('cores', '?')} cores, Python {run.get('python', '?')}"
        )
    seeds = sorted({row.seed for row in contents.rows})
    places = "; ".join(dict.fromkeys(said)) or "environment not recorded"
    return f"Run on: {places}. Seeds: {', '.join(map(str, seeds))}."


def method_notes(contents: Contents) -> list[str]:
    """What was done to a surface before a method saw it, and which methods are no rivals."""
    notes = []
    if contents.atlases:
        notes.append(
            f"Not ranked: {', '.join(sorted(contents.atlases))}, which cut the surface into many "
            "charts; the others give one map of the whole."
        )
    steps: dict[str, set[str]] = {}
    for row in contents.rows:
        if row.preprocessing:
            steps.setdefault(row.preprocessing, set()).add(row.case)
    for step, cases in steps.items():
        notes.append(
            f"{step.capitalize()}, the same for every method that needs it: "
            f"{', '.join(sorted(cases))}."
        )
    return notes


def _metric(name: str, title: str = "", **given: object) -> Column:
    """The column of a metric; `seconds` counts as one."""
    if name == "seconds":
        return Column("seconds", title or "time [s]", better="lower", digits=2)
    metric = METRICS[name]
    digits = 4 if metric.unit == "radians" else 3
    column = Column(
        name,
        title or metric.label,
        better=metric.better if metric.better in ARROWS else "",
        digits=2 if name.endswith("_fraction") else digits,
        percent=name.endswith("_fraction"),
    )
    return Column(**{**column.__dict__, **given})


def _measured(record: Mapping[str, object] | None, name: str) -> Value:
    """The value of a metric in a row of `Contents.means`, or None where there is none."""
    value = record.get(name) if record else None
    if not isinstance(value, int | float) or math.isnan(value):
        return None
    return float(value)


def _records(contents: Contents) -> dict[tuple[str, str], dict[str, object]]:
    """The rows of `contents.means` by (case, label)."""
    return {
        (str(record["case"]), str(record["label"])): {str(k): v for k, v in record.items()}
        for record in contents.means.to_dict("records")
    }


def conformality(contents: Contents) -> Table:
    """The supplement's table: models × methods, published figures in columns of their own."""
    records = _records(contents)
    columns = [Column("case", "Model", text=True)]
    columns += [
        Column(label.short, label.short, better="lower", digits=4, group="Measured here")
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
            record = records.get((case, label.short))
            value = _measured(record, ANGLE)
            status = str(record["status"]).replace("_", " ") if record else ""
            row[label.short] = value if value is not None else (status if status != "ok" else "")
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
        set_apart=contents.atlases,
        notes=(
            _legend(contents),
            *method_notes(contents),
            *_published_notes(authors),
            environment_note(contents),
        ),
    )


def _legend(contents: Contents) -> str:
    """What the short names of the methods stand for."""
    told = [f"{label.short}: {label.detail}" for label in contents.methods if label.detail]
    return f"Methods. {'; '.join(told)}."


def _published_notes(authors: Sequence[str]) -> list[str]:
    if not authors:
        return []
    return [
        (
            "Published figures are those of the ParaPoint supplement (SLIM, ParaPoint) and of FAM, "
            "NeurIPS 2024 (FAM), on files that are not public; they are never ranked with ours."
        )
    ]


def supplement(contents: Contents) -> Table:
    """Each model's methods with angle distortion, area distortion, flips and spanning faces."""
    records = _records(contents)
    judged: dict[tuple[str, str], Verdict] = {
        (verdict.case, verdict.label.short): verdict for verdict in verdicts(contents)
    }
    without = f"{ANGLE}_without_spanning"
    area_without = f"{AREA}_without_spanning"
    columns = [
        Column("case", "Model", text=True, once=True),
        Column("method", "Method", text=True),
        _metric(ANGLE, "all faces", group="Angle difference [rad]"),
        _metric(without, "no spanning", group="Angle difference [rad]"),
        _metric(AREA, "all faces", group="Area discrepancy [0–2]"),
        _metric(area_without, "no spanning", group="Area discrepancy [0–2]"),
        _metric(FLIPPED, "flipped %"),
        Column(SPANNING, "spanning %", digits=2, percent=True),
        Column("chart_count", "charts", digits=0),
        Column("seam_length", "seam", digits=2),
        _metric("seconds"),
        Column("done", "ok", text=True),
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
    for case in contents.cases:
        rows: list[dict[str, Value]] = []
        for label in contents.methods:
            record = records.get((case, label.short))
            if record is None:
                continue
            cut = " + automatic cut" if CUT in str(record["preprocessing"]) else ""
            row: dict[str, Value] = {
                "case": f"{case} ({claim_text(case)})" if authors else case,
                "method": label.text + cut,
                **{
                    name: _measured(record, name)
                    for name in (ANGLE, without, AREA, area_without, FLIPPED)
                },
                "label": label.short,
                **{
                    name: _measured(record, name)
                    for name in (SPANNING, "chart_count", "seam_length")
                },
                "seconds": _measured(record, "seconds"),
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
            "Per model: the paper's conformality over all faces, as published, and without the "
            "faces that span a learned seam; the same for the area discrepancy (0 for an "
            "equal-area map, at most 2); flipped and seam-spanning faces; charts; length of the "
            "seams over the root of "
            "the surface's area; time; runs that ended well of those tried."
        ),
        columns=tuple(columns),
        blocks=tuple(blocks),
        set_apart=contents.atlases,
        notes=(
            *method_notes(contents),
            *_published_notes(authors),
            *_failure_notes(contents),
            environment_note(contents),
        ),
    )


def _failure_notes(contents: Contents) -> list[str]:
    """One line a way in which cells did not end well."""
    reasons: dict[tuple[str, str, str], list[str]] = {}
    for row in contents.rows:
        if row.status != "ok":
            key = (contents.labels[row.id].short, row.status.replace("_", " "), row.reason)
            reasons.setdefault(key, []).append(row.case)
    return [
        f"{method} {status} on {', '.join(dict.fromkeys(cases))}: {reason or 'no reason given'}."
        for (method, status, reason), cases in reasons.items()
    ]


def comparison(contents: Contents, names: Sequence[str] = ()) -> Table:
    """Methods × metrics: mean, median and worst over each method's own models, and common means.

    `names` are the metrics: SUMMARY_METRICS unless given. The common mean is over the models on
    which every method that ever succeeded did, so that nobody gains by failing.
    """
    means = contents.means
    good = means[means["ok"] > 0]
    able = [label for label in contents.methods if (good["label"] == label.short).any()]
    common = [
        case
        for case in contents.cases
        if all(((good["case"] == case) & (good["label"] == label.short)).any() for label in able)
    ]
    blocks = []
    for name in names or SUMMARY_METRICS:
        if name not in means.columns or not good[name].notna().any():
            continue
        rows: list[dict[str, Value]] = []
        column = _metric(name)
        for label in contents.methods:
            own = good[good["label"] == label.short]
            values = own[name].dropna()
            shared = own[own["case"].isin(common)][name].dropna()
            tried = means[means["label"] == label.short]
            worst = values.max() if column.better != "higher" else values.min()
            rows.append(
                {
                    "metric": _metric_title(name),
                    "method": label.short,
                    "label": label.short,
                    **_scaled(column, "mean", values.mean() if len(values) else None),
                    **_scaled(column, "median", values.median() if len(values) else None),
                    **_scaled(column, "worst", worst if len(values) else None),
                    **_scaled(column, "common", shared.mean() if len(shared) else None),
                    "count": f"{len(values)}/{int((tried['tried'] > 0).sum())}",
                    "skipped": float((tried["skipped"] > 0).sum()),
                    "better": column.better,
                }
            )
        blocks.append(tuple(rows))
    shown = f"{len(common)}: {', '.join(common)}" if 0 < len(common) <= 12 else str(len(common))
    return Table(
        name="comparison",
        title="All methods over all models",
        caption=(
            "Each metric over the models: mean, median and worst over those on which the method "
            "ended well (their count beside it, of those tried), and the mean over the models on "
            f"which all methods did ({shown})."
        ),
        columns=(
            Column("metric", "Metric", text=True, once=True),
            Column("method", "Method", text=True),
            Column("mean", "mean", better="lower", digits=4),
            Column("median", "median", better="lower", digits=4),
            Column("worst", "worst", better="lower", digits=4),
            Column("common", "common mean", better="lower", digits=4),
            Column("count", "ok / tried", text=True),
            Column("skipped", "skipped", digits=0),
        ),
        blocks=tuple(blocks),
        set_apart=contents.atlases,
        notes=(
            *method_notes(contents),
            *_failure_notes(contents),
            environment_note(contents),
        ),
    )


def _scaled(column: Column, key: str, value: float | None) -> dict[str, Value]:
    return {key: 100 * float(value) if column.percent and value is not None else value}


def _metric_title(name: str) -> str:
    column = _metric(name)
    unit = "" if name == "seconds" or not METRICS[name].unit else f" [{METRICS[name].unit}]"
    return f"{column.title}{' %' if column.percent else unit}"


def against_published(contents: Contents) -> Table | None:
    """Measured against published numbers with claim, tolerance and verdict; None without any."""
    judged = verdicts(contents)
    if not judged:
        return None
    blocks: dict[str, list[Mapping[str, Value]]] = {}
    for verdict in judged:
        blocks.setdefault(verdict.case, []).append(
            {
                "case": f"{verdict.case} (paper: {verdict.paper_name})",
                "claim": claim_text(verdict.case),
                "method": verdict.label.text,
                "measured": verdict.measured,
                "published": verdict.published,
                "difference": verdict.measured - verdict.published,
                "tolerance": verdict.tolerance,
                "verdict": verdict.text,
            }
        )
    return Table(
        name="published",
        title="Published against measured",
        caption=(
            "Conformality measured here against the figure that was published for the method. A "
            "verdict is given only where our file is, or likely is, the authors' own model."
        ),
        columns=(
            Column("case", "Model", text=True, once=True),
            Column("claim", "Our file is", text=True, once=True),
            Column("method", "Method", text=True),
            Column("measured", "measured", digits=4),
            Column("published", "published"),
            Column("difference", "difference"),
            Column("tolerance", "tolerance"),
            Column("verdict", "Verdict", text=True),
        ),
        blocks=tuple(tuple(rows) for rows in blocks.values()),
        notes=(environment_note(contents),),
    )


def failures(contents: Contents) -> Table | None:
    """Every cell that did not end well, with its reason; None where all did."""
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
        title="Cells that did not end well",
        caption="Skipped: the method says beforehand that it cannot take the surface.",
        columns=(
            Column("case", "Model", text=True),
            Column("method", "Method", text=True),
            Column("seed", "seed", digits=0),
            Column("status", "status", text=True),
            Column("reason", "reason", text=True),
            Column("seconds", "time [s]", digits=1),
        ),
        blocks=(tuple(rows),),
    )


def everything(contents: Contents) -> Table:
    """One row a cell with every metric: the CSV for other programs."""
    names = ["seconds", *contents.metrics]
    by_id = contents.measured.set_index("id").to_dict("index")
    rows = tuple(
        {
            "case": row.case,
            "method": contents.labels[row.id].text,
            "seed": float(row.seed),
            "status": row.status,
            **{
                name: _measured({str(k): v for k, v in by_id[row.id].items()}, name)
                for name in names
            },
        }
        for row in contents.rows
    )
    return Table(
        name="cells",
        title="Every cell",
        caption="Every metric of every cell.",
        columns=(
            Column("case", "Model", text=True),
            Column("method", "Method", text=True),
            Column("seed", "seed", digits=0),
            Column("status", "status", text=True),
            *(_metric(name) for name in names),
        ),
        blocks=(rows,),
        notes=(environment_note(contents),),
    )


def tables(contents: Contents) -> list[Table]:
    """The tables of a suite, the one to read first first."""
    made = [
        conformality(contents),
        against_published(contents),
        supplement(contents),
        comparison(contents),
        failures(contents),
    ]
    return [table for table in made if table is not None]
