"""A page for each method: what it is, and all its maps, suite by suite."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.commands.listing import about
from reports.contents import ANGLE, AREA, FLIPPED, WORST_PART, number
from reports.labels import Label
from reports.page import pages
from reports.page.sections import Section
from reports.pictures.names import map_file, slug
from reports.tables.leaderboard import page_of
from reports.tables.table import SHORT, metric_column

SHOWN = {
    **{name: SHORT[name] for name in (ANGLE, AREA, FLIPPED)},
    WORST_PART: "worst part",
    "seconds": "time [s]",
    "cpu_seconds": "processor [s]",
}
"""The metrics on a method's page, and their heads."""


@dataclass(frozen=True)
class Line:
    """A model on the page of a method.

    Attributes:
        suite: name of the suite.
        case: the model.
        page: address of its page, from the method's.
        picture: address of the map's picture; "" where there is none.
        grade: of the map, or how the cell ended.
        mark: "bad" where there is no map, or a broken or collapsed one.
        values: the metrics of SHOWN, printed.
    """

    suite: str
    case: str
    page: str
    picture: str
    grade: str
    mark: str
    values: Sequence[str]


def address(label: Label) -> str:
    """Address of a method's page, from the index."""
    return f"methods/{slug(f'{label.method} {label.params}')}.html"


def write(out: Path, sections: Sequence[Section]) -> list[tuple[str, str]]:
    """Write the page of each method; title and address of each, from the index."""
    found: dict[tuple[str, str], tuple[Label, list[Section]]] = {}
    for section in sections:
        for label in section.contents.methods:
            key = (label.method, label.params)
            found.setdefault(key, (label, []))[1].append(section)
    links = []
    for key, (label, own) in found.items():
        lines = [line for section in own for line in _lines(section, key)]
        heads = [metric_column(name, title).head for name, title in SHOWN.items()]
        pages.put(out / address(label), pages.method_page(label, about(label.method), heads, lines))
        links.append((label.text, address(label)))
    return links


def _lines(section: Section, key: tuple[str, str]) -> list[Line]:
    """The models of a suite under a method."""
    contents = section.contents
    label = next(one for one in contents.methods if (one.method, one.params) == key)
    found = []
    for case in contents.cases:
        record = contents.records.get((case, label.short))
        if record is None:
            continue
        row = contents.shown(case, label)
        kind = "dense" if case in contents.clouds else "checker-1"
        picture = section.picture(map_file(row, kind)) if row else ""
        grade = str(record["grade"] or "") if row else str(record["status"]).replace("_", " ")
        found.append(
            Line(
                contents.suite,
                case,
                f"../{page_of(contents, case)}",
                f"../{picture}" if picture else "",
                grade,
                "bad" if row is None or grade in {"broken", "collapsed"} else "",
                [metric_column(name).shown(number(record, name)) for name in SHOWN],
            )
        )
    return found
