"""Methods side by side: what each reads, how many charts it makes, and what its maps are worth."""

from __future__ import annotations

from reports.contents import (
    ANGLE,
    BIJECTIVE,
    ISOMETRIC,
    POINT_ANGLE,
    POINT_AREA,
    WORST_PART,
    Contents,
    number,
)
from reports.means import common_cases, own_values, statistic
from reports.tables.kinds import means
from reports.tables.notes import environment_note, failure_notes, load_notes, method_notes
from reports.tables.table import METHOD, Column, Table, Value, share, short_columns

MEANS = (ANGLE, ISOMETRIC, "stretch_l2")
"""The metrics whose means over the common models stand side by side."""
MEANS_OF_CLOUDS = (POINT_ANGLE, POINT_AREA)
"""The same where no model has faces."""


def methods(contents: Contents) -> Table:
    """One row a method, over all models: validity and the worst part before any mean."""
    common = common_cases(contents, contents.cases)
    of_clouds = contents.clouds.issuperset(contents.cases)
    names = MEANS_OF_CLOUDS if of_clouds else MEANS
    rows = []
    for label in contents.methods:
        found = [contents.records.get((case, label.short)) for case in contents.cases]
        own = [record for record in found if record is not None]
        usable = sum(record["grade"] == "usable" for record in own)
        bijective = sum(number(record, BIJECTIVE) == 1 for record in own)
        row: dict[str, Value] = {
            "method": label.short,
            "label": label.short,
            "input": label.input,
            "ok": share(sum(record["ok"] > 0 for record in own), len(own)),
            "usable": share(usable, len(own)),
            "one to one": share(bijective, len(own)),
            "charts": statistic("median", own_values(contents, label, "chart_count"), ""),
            WORST_PART: statistic("worst", own_values(contents, label, WORST_PART), "higher"),
            "coverage": statistic("mean", own_values(contents, label, "coverage"), ""),
        }
        rows.append(row | means(contents, label, names, common))
    columns = [
        METHOD,
        Column("input", "reads", text=True),
        Column("ok", "ok", text=True),
        Column("usable", "usable", text=True),
        Column("one to one", "1 to 1", text=True),
        Column("charts", "charts", digits=0),
        Column(WORST_PART, "worst part", digits=2),
        Column("coverage", "coverage %", digits=1, percent=True),
        *short_columns(names),
    ]
    if of_clouds:  # without faces none can lie on another
        columns = [column for column in columns if column.key != "one to one"]
    return Table(
        name="methods",
        title="Methods side by side",
        caption=(
            "What a method reads: a mesh, or its points alone. On how many models it gave a map, a "
            "usable one, and one that is one to one (no face is flipped, degenerate or over "
            "another; its cut may be learned, and faces then span it). The charts, as the median; "
            "the smallest part of all its maps, as a share of its fair area; the mean share of "
            f"the surface that has a place. Means are over the {len(common)} models on which every "
            "method gave a map that gives one anywhere. Means over too many broken maps, or for "
            "other than angles collapsed ones, take no part in best and second."
        ),
        columns=tuple(columns),
        blocks=(tuple(rows),),
        set_apart=contents.unranked,
        notes=(
            *method_notes(contents),
            *failure_notes(contents),
            *load_notes(contents),
            environment_note(contents),
        ),
    )
