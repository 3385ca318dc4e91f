"""The page: one index.html that opens from disk, with the tables first."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from benchmarks.metrics import METRICS
from benchmarks.results import ResultRow
from parapoint.errors import InputError
from reports.contents import Contents, Label, suite_title
from reports.figures import Drawn
from reports.galleries import values_text
from reports.pictures import MAP_PICTURES, map_file, model_file, slug
from reports.table import Table, grouped


@dataclass(frozen=True)
class Section:
    """What the page says of a suite.

    Attributes:
        contents: its cells.
        tables: the one to read first first.
        figures: those that were drawn.
        faults: what could not be drawn, and why.
    """

    contents: Contents
    tables: Sequence[Table]
    figures: Sequence[Drawn]
    faults: Sequence[str]

    @property
    def name(self) -> str:
        """Name of the suite."""
        return self.contents.suite

    @property
    def folder(self) -> str:
        """Folder of its files, below tables/ and figures/."""
        return slug(self.name)

    @property
    def title(self) -> str:
        """Heading of the suite."""
        return suite_title(self.name)

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells by status."""
        found: dict[str, int] = {}
        for row in self.contents.rows:
            status = row.status.replace("_", " ")
            found[status] = found.get(status, 0) + 1
        return found

    @property
    def overview(self) -> list[Drawn]:
        """The figures that are about all models."""
        return [one for one in self.figures if not one.name.startswith(("maps-", "heat-"))]

    def figures_of(self, case: str) -> list[Drawn]:
        """The figures that are about one model."""
        names = {f"maps-{slug(case)}", f"heat-{slug(case)}"}
        return [one for one in self.figures if one.name in names]

    def row(self, case: str, label: Label) -> ResultRow | None:
        """The cell that is shown for a model and a method: an ok one if there is one."""
        rows = self.contents.cell(case, label)
        return self.contents.shown(case, label) or (rows[0] if rows else None)

    def values(self, row: ResultRow) -> str:
        """The numbers below the pictures of a cell."""
        return values_text(self.contents, row)

    def picture(self, row: ResultRow, kind: str) -> str:
        """Address of a picture of a map, from the page."""
        return f"figures/{self.folder}/pictures/{map_file(row, kind)}"

    def model_picture(self, case: str, kind: str) -> str:
        """Address of a picture of a model, from the page."""
        return f"figures/{self.folder}/pictures/{model_file(case, kind)}"

    @property
    def command(self) -> str:
        """The command that runs the suite's cells again."""
        seeds = ",".join(str(seed) for seed in sorted({row.seed for row in self.contents.rows}))
        cases = ",".join(self.contents.cases)
        return shlex.join(
            ["python", "-m", "benchmarks", "run", self.name, "--cases", cases, "--seeds", seeds]
        )

    @property
    def runs(self) -> list[dict[str, str]]:
        """The environments in which the cells ran, entry by entry."""
        used = {row.run for row in self.contents.rows}
        try:
            entries = self.contents.store.environment()["runs"]
        except InputError:
            return []
        return [
            {str(name): _told(value) for name, value in entry.items()}
            for number, entry in enumerate(entries)
            if number in used and isinstance(entry, Mapping)
        ]


def _told(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_told(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return ", ".join(_told(entry) for entry in value) or "none"
    return str(value)


def definition(key: str) -> str:
    """What a metric is, for the tooltip of its head; "" for other columns."""
    metric = METRICS.get(key)
    if metric is None:
        return ""
    ideal = "" if metric.ideal is None else f"; ideal {metric.ideal:g}"
    return f"{metric.heading}; weighting: {metric.weighting}{ideal}; {metric.source}"


def page(folder: Path, sections: Sequence[Section]) -> str:
    """The HTML of the report on the results in `folder`."""
    environment = Environment(
        loader=PackageLoader("reports"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("index.html").render(
        sections=sections,
        folder=str(folder),
        report_command=shlex.join(["python", "-m", "reports", str(folder)]),
        grouped=grouped,
        definition=definition,
        kinds=MAP_PICTURES,
        params=_params,
    )


def _params(label: Label) -> str:
    return json.dumps(label.parameters, ensure_ascii=False) if label.parameters else "none"
