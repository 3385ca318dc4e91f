"""What works on which kind of surface: successes and means, kind by kind."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.metrics.grades import BOUNDS
from reports.contents import (
    ANGLE,
    AREA,
    BIJECTIVE,
    FLIPPED,
    ISOMETRIC,
    OVERLAPPED,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    Contents,
    number,
)
from reports.labels import Label
from reports.means import common_cases, common_values, statistic
from reports.ranking import TIMES, means_may_rank
from reports.tables.notes import environment_note, failure_notes, legend, load_notes, method_notes
from reports.tables.published import model
from reports.tables.table import (
    DONE,
    METHOD,
    Column,
    Table,
    Value,
    metric_column,
    share,
    short_columns,
)


def kind(contents: Contents, case: str) -> str:
    """What sort of surface a model is: its topology, or where it is from if that matters more."""
    entry = model(case)
    if entry is not None and entry.set in {"wild", "scans"}:
        return {"wild": "defective", "scans": "scans"}[entry.set]
    mesh = None if entry else contents.mesh(case)
    without = "clouds" if case in contents.clouds else "unknown"
    topology = entry.topology if entry else mesh.topology if mesh else without
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
    """How often each method gives a map, a usable one, one that is one to one, kind by kind."""
    groups = {"all": contents.cases} | kinds(contents)
    if len(groups) == 2:  # one kind, which is all
        del groups["all"]
    rows = []
    for label in contents.methods:
        row: dict[str, Value] = {"method": label.short, "label": label.short}
        for name, cases in groups.items():
            records = [contents.records.get((case, label.short)) for case in cases]
            own = [record for record in records if record is not None]
            row[f"{name} ok"] = share(sum(record["ok"] > 0 for record in own), len(own))
            bijective = sum(number(record, BIJECTIVE) == 1 for record in own)
            row[f"{name} {BIJECTIVE}"] = share(bijective, len(own))
            usable = sum(record["grade"] == "usable" for record in own)
            row[f"{name} usable"] = share(usable, len(own))
        rows.append(row)
    columns = [METHOD]
    for name, cases in groups.items():
        shown = {"usable": "usable", "ok": "ok", BIJECTIVE: "1 to 1"}
        if contents.clouds.issuperset(cases):
            del shown[BIJECTIVE]
        columns += [
            Column(f"{name} {key}", title, text=True, group=f"{name}: {len(cases)}")
            for key, title in shown.items()
        ]
    return Table(
        name="success",
        title="Success by kind of surface",
        caption=(
            "Each head names a kind of surface and the number of its models. A success is a usable "
            "map. Beside the successes stand the models on which the method gave any map (ok), "
            "with at least one seed, and those on which all its maps are one to one: no face is "
            "flipped, degenerate or over another. All are counted of the models that the method "
            "was asked for, those that it skipped included."
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


KIND_METRICS = (
    *(ANGLE, AREA, ISOMETRIC, FLIPPED, OVERLAPPED),
    *(POINT_ANGLE, POINT_AREA, POINT_COLLISIONS, POINT_TEARS),
    *TIMES,
)
"""The metrics that are told kind by kind."""


def means(
    contents: Contents, label: Label, names: Sequence[str], cases: Sequence[str]
) -> dict[str, Value]:
    """The entries of a row: a method's means of metrics over `cases`, and whether they may rank."""
    records = [contents.records.get((case, label.short)) for case in cases]
    grades = [record["grade"] for record in records if record]
    row: dict[str, Value] = {}
    for name in names:
        column = metric_column(name)
        values = common_values(contents, label, name, cases)
        row[name] = statistic("mean", values, column.better)
        row[f"grade {name}"] = "" if means_may_rank(grades, angles=column.angles) else "broken"
    return row


def means_by_kind(contents: Contents) -> Table:
    """Kinds of surface × methods: means over the models that all methods can do."""
    names = [name for name in KIND_METRICS if contents.means[name].notna().any()]
    blocks = []
    for name, cases in kinds(contents).items():
        common = common_cases(contents, cases)
        block = []
        for label in contents.methods:
            found = [contents.records.get((case, label.short)) for case in cases]
            own = [record for record in found if record is not None]
            row: dict[str, Value] = {
                "kind": f"{name}: means over {len(common)} of {len(cases)}",
                "method": label.short,
                "label": label.short,
                "done": share(sum(record["ok"] > 0 for record in own), len(own)),
            }
            block.append(row | means(contents, label, names, common))
        blocks.append(tuple(block))
    return Table(
        name="kinds",
        title="Means by kind of surface",
        caption=(
            "Means over the models on which every method gave a map that gives one anywhere on "
            "this kind of surface, so that nobody gains by failing. The last column counts those "
            "on which the method gave a map. Means over too many broken maps, or for other than "
            "angles collapsed ones, take no part in best and second."
        ),
        columns=(
            Column("kind", "Surface", text=True, once=True),
            METHOD,
            *short_columns(names),
            DONE,
        ),
        blocks=tuple(blocks),
        set_apart=contents.unranked,
        notes=(
            legend(contents),
            *method_notes(contents),
            *load_notes(contents),
            environment_note(contents),
        ),
    )
