"""What one change does, model by model: to a parameter (ablation), or to the cut."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.cases.derived import is_drawn
from parapoint.surfaces.preparation import CUT
from reports.contents import (
    ANGLE,
    AREA,
    BIJECTIVE,
    FLIPPED,
    ISOMETRIC,
    OVERLAPPED,
    SPANNING,
    Contents,
    number,
)
from reports.tables.notes import (
    environment_note,
    failure_notes,
    grade_notes,
    legend,
    method_notes,
)
from reports.tables.table import CASE, DONE, METHOD, Column, Table, Value, short_columns


def ablation(contents: Contents) -> Table | None:
    """Variants of one method, model by model; None where the suite has several methods."""
    if len(contents.methods) < 2 or len({label.method for label in contents.methods}) > 1:
        return None
    names = (ANGLE, AREA, ISOMETRIC, FLIPPED, OVERLAPPED, SPANNING, "seam_length", "seconds")
    return Table(
        name="ablation",
        title=f"Ablation of {contents.methods[0].name}",
        caption=(
            "Each variant makes one change. Values are over all faces, means over the seeds that "
            "gave a map. A low distortion is worth nothing where many faces overlap or are flipped."
        ),
        columns=(
            CASE,
            Column("method", "Variant", text=True),
            *short_columns(names),
            DONE,
        ),
        blocks=tuple(_block(contents, case, names) for case in contents.cases),
        notes=(
            legend(contents),
            *grade_notes(contents),
            *failure_notes(contents),
            environment_note(contents),
        ),
    )


def _block(contents: Contents, case: str, names: Sequence[str]) -> tuple[Mapping[str, Value], ...]:
    """A row for each method on a model: its grade, the metrics `names`, its seeds with a map."""
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
                "grade": str(record["grade"]),
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
            CASE,
            METHOD,
            Column("cut", "Cut", text=True),
            *short_columns(names),
            Column(BIJECTIVE, "bijective", text=True),
            DONE,
        ),
        blocks=tuple(blocks),
        set_apart=contents.unranked.union(lengths),
        notes=(
            *grade_notes(contents),
            *method_notes(contents),
            *failure_notes(contents),
            environment_note(contents),
        ),
    )


def _cut(record: Mapping[str, object]) -> str:
    """How a model was cut for, or by, a method."""
    if not record["ok"]:
        return ""
    if (number(record, SPANNING) or 0) > 0:
        return "learned"
    if CUT in str(record["preprocessing"]):
        return "automatic"
    if is_drawn(str(record["case"])):
        return "drawn"
    return "its own" if (number(record, "seam_length") or 0) > 0 else "none"
