"""What the pages say of a suite: its models, their maps, the numbers below each."""

from __future__ import annotations

import json
import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from PIL import Image

from benchmarks.cases.suites import SUITES
from benchmarks.running import planning
from benchmarks.store.rows import SUBMITTED, ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.surface import Mesh
from reports.contents import (
    AREA,
    FLIPPED,
    FLIPPED_OFF_SEAM,
    SHEETS,
    Contents,
    number,
    suite_title,
)
from reports.labels import Label
from reports.pictures import exports
from reports.pictures.figures import Drawn
from reports.pictures.names import VIEWED, map_file, model_file, slug
from reports.tables import leaderboard
from reports.tables.leaderboard import MEASURES, SHOWN, Glance, Winner, definition, page_of, winner
from reports.tables.notes import load_notes, version_notes
from reports.tables.published import published_values
from reports.tables.table import Table, metric_column

TILES = {"surface": "checker-1", "UV layout": "layout"}

POINT_TILES = {
    "points, by their normals": "cloud",
    "UV": "cloud-uv",
    "checkerboard": "dense",
    "where the map tears": "seams",
}
"""What is shown of a map of a mesh, and of one of points: the kinds of the pictures."""


@dataclass(frozen=True)
class Number:
    """A number below a map: what it is, printed, and whether it is the best of the model."""

    title: str
    text: str
    mark: str
    definition: str


@dataclass(frozen=True)
class Model:
    """What the index says of a model."""

    name: str
    page: str
    picture: str
    winners: Sequence[tuple[str, Winner]]
    bad: str


@dataclass(frozen=True)
class Example:
    """A map as the head of the index shows it: small, with its grade and flips in words.

    Attributes:
        name: of the method.
        pictures: addresses: one view, or two where some faces are flipped.
        said: grade and share of flipped faces; of a cell without a map, how it ended.
        mark: "bad" where there is no map, or a broken or collapsed one; else "".
    """

    name: str
    pictures: Sequence[str]
    said: str
    mark: str


@dataclass(frozen=True)
class Card:
    """What a model's page says of a method.

    Attributes:
        label: the method.
        row: its cell.
        detail: its parameters that are told.
        grade: of its map; "" where there is none, or it is not known.
        map: address of what the viewer reads, from the page; "" where there is none.
        pictures: addresses by what they show; of a mesh two, which the viewer takes the place of.
        numbers: the metrics of SHOWN.
        exports: name and address of its textured meshes, where they were written.
    """

    label: Label
    row: ResultRow
    detail: str
    grade: str
    map: str
    pictures: Mapping[str, str]
    numbers: Sequence[Number]
    exports: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class Section:
    """What the page says of a suite.

    Attributes:
        report: the folder of the report.
        contents: its cells.
        tables: in the order in which to read them.
        figures: those that were drawn.
        faults: what could not be drawn, and why.
        results: the folder that its commands name: the one that it was made from.
    """

    report: Path
    contents: Contents
    tables: Sequence[Table]
    figures: Sequence[Drawn]
    faults: Sequence[str]
    results: Path

    @property
    def name(self) -> str:
        """Name of the suite."""
        return self.contents.suite

    @property
    def folder(self) -> str:
        """Folder of its files, below tables/, figures/ and models/."""
        return slug(self.name)

    @property
    def title(self) -> str:
        """Heading of the suite."""
        return suite_title(self.name)

    @property
    def counts(self) -> dict[str, int]:
        """Number of cells by status."""
        return dict(Counter(row.status.replace("_", " ") for row in self.contents.rows))

    @property
    def warnings(self) -> list[str]:
        """What a reader must know: mixed versions, and times that a busy machine made unsure."""
        return [*version_notes(self.contents), *load_notes(self.contents)]

    @property
    def unfinished(self) -> list[ResultRow]:
        """The cells without a map."""
        return [row for row in self.contents.rows if row.status != "ok"]

    @property
    def worst_methods(self) -> list[str]:
        """The methods with most cells that were tried in vain, and how many were not tried."""
        tried = [row for row in self.unfinished if row.status != "skipped"]
        found = Counter(self.contents.labels[row.id].short for row in tried).most_common(3)
        lines = [f"{name}: {count} failed" for name, count in found]
        skipped = len(self.unfinished) - len(tried)
        return [*lines, f"{skipped} skipped beforehand"] if skipped else lines

    @cached_property
    def glances(self) -> dict[str, Glance]:
        """Who is best at what, by its title."""
        return {one.title: one for one in leaderboard.glances(self.contents)}

    @cached_property
    def examples(self) -> dict[str, list[Example]]:
        """The maps of every method, model by model; of many models SHEETS, the most telling.

        Those that most methods map; of these the paper's, and those that differ most in areas.
        """
        shown = {
            case: [self._example(case, label) for label in self.contents.methods]
            for case in self.contents.cases
        }

        def worth(case: str) -> tuple[int, bool, float]:
            records = [
                self.contents.records.get((case, label.short)) for label in self.contents.methods
            ]
            areas = [area for one in records if (area := number(one, AREA)) is not None]
            spread = max(areas) - min(areas) if areas else 0.0
            return (
                sum(bool(one.pictures) for one in shown[case]),
                bool(published_values(case)),
                spread,
            )

        best = sorted(shown, key=worth, reverse=True)[:SHEETS]
        return {
            case: shown[case]
            for case in shown
            if case in best and any(one.pictures for one in shown[case])
        }

    def _example(self, case: str, label: Label) -> Example:
        """The map of a method on a model, small, with its grade and the flips that this counts."""
        row = self.contents.shown(case, label)
        if row is None:
            rows = self.contents.cell(case, label)
            return Example(label.short, (), rows[0].status.replace("_", " ") if rows else "", "bad")
        kinds = ["dense" if case in self.contents.clouds else TILES["surface"]]
        values = self._values[row.id]
        flipped = number(values, FLIPPED_OFF_SEAM) or 0
        if flipped:
            kinds.append("checker-2")
        pictures = [self.picture(map_file(row, kind)) for kind in kinds]
        told = f"{metric_column(FLIPPED).shown(flipped)} % flipped" if flipped else ""
        grade = str(values["grade"] or "")
        said = ", ".join(part for part in (grade, told) if part)
        mark = "bad" if grade in {"broken", "collapsed"} else ""
        return Example(label.short, [address for address in pictures if address], said, mark)

    @property
    def overview(self) -> list[Drawn]:
        """The figures that are about all models."""
        return [one for one in self.figures if not one.name.startswith(("maps-", "heat-"))]

    def figures_of(self, case: str) -> list[Drawn]:
        """The figures that are about one model."""
        names = {f"maps-{slug(case)}", f"heat-{slug(case)}"}
        return [one for one in self.figures if one.name in names]

    def size(self, one: Drawn) -> tuple[int, int]:
        """Width and height of a figure in pixels, so that the page need not move when it comes."""
        with Image.open(self.report / f"figures/{self.folder}/{one.name}.png") as image:
            return image.size

    def picture(self, name: str) -> str:
        """Address of a file beside the pictures, from the index; "" where it was not drawn."""
        address = f"figures/{self.folder}/pictures/{name}"
        return address if (self.report / address).is_file() else ""

    @cached_property
    def models(self) -> list[Model]:
        """What the index says of each model."""
        return [self._model(case) for case in self.contents.cases]

    def _model(self, case: str) -> Model:
        rows = [row for row in self.unfinished if row.case == case]
        bad = Counter(row.status.replace("_", " ") for row in rows)
        won = [(title, winner(self.contents, case, metric)) for title, metric in MEASURES.items()]
        return Model(
            case,
            page_of(self.contents, case),
            self.picture(model_file(case, "mesh-1")),
            [(title, one) for title, one in won if one is not None],
            ", ".join(f"{count} {status}" for status, count in bad.items()),
        )

    def cards(self, case: str) -> list[Card]:
        """The methods on a model."""
        found = []
        for label in self.contents.methods:
            rows = self.contents.cell(case, label)
            if not rows:
                continue
            row = self.contents.shown(case, label) or rows[0]
            seed = f"seed {row.seed} of {len(rows)}" if len(rows) > 1 else ""
            viewed = self.picture(map_file(row, VIEWED)) if row.status == "ok" else ""
            found.append(
                Card(
                    label,
                    row,
                    ", ".join(part for part in (label.detail, seed) if part),
                    str(self._values[row.id]["grade"] or ""),
                    f"../../{viewed}" if viewed else "",
                    self._pictures(row),
                    self._numbers(case, label, row),
                    [
                        (name, f"../../{address}")
                        for name, address in exports.written(self.report, row).items()
                    ],
                )
            )
        return found

    def _pictures(self, row: ResultRow) -> dict[str, str]:
        """The pictures of a map by what they show."""
        shown = POINT_TILES if row.case in self.contents.clouds else TILES
        found = {text: self.picture(map_file(row, kind)) for text, kind in shown.items()}
        return {text: f"../../{address}" for text, address in found.items() if address}

    def _numbers(self, case: str, label: Label, row: ResultRow) -> list[Number]:
        """The metrics of SHOWN of a cell; what should be none is marked where there is some."""
        found = []
        for metric in SHOWN:
            value = self._values[row.id][metric]
            if not isinstance(value, float) or math.isnan(value):
                continue
            column = metric_column(metric)
            if column.percent:
                mark = "bad" if value > 0 else ""
            else:
                best = winner(self.contents, case, metric)
                mark = "best" if best and label.short in best.names else ""
            text = column.shown(value) + (" %" if column.percent else "")
            found.append(Number(column.title, text, mark, definition(metric)))
        return found

    @cached_property
    def _values(self) -> dict[Any, dict[Any, Any]]:
        """Every metric of each cell, by its id."""
        return self.contents.measured.set_index("id").to_dict("index")

    def about(self, case: str) -> str:
        """The size and the kind of a model."""
        for row in self.contents.rows:
            if row.case == case and row.surface_hash:
                try:
                    surface = self.contents.store.surface(row)
                except InputError:
                    break
                if isinstance(surface, Mesh):
                    vertices, faces = len(surface.vertices), len(surface.faces)
                    return f"{vertices:,} vertices, {faces:,} faces; {surface.topology}."
                return f"A cloud of {len(surface.points):,} points."
        return "The model could not be had."

    @property
    def suite_command(self) -> str:
        """The command that runs the whole suite; "" for one of the user's own, which has no name.

        As the other commands, it goes on in the folder that the report was made from.
        """
        if self.name not in SUITES:
            return ""
        return shlex.join(["nox", "-s", "bench", "--", self.name, "--out", str(self.results)])

    @property
    def report_command(self) -> str:
        """The command that writes the report."""
        return shlex.join(["python", "-m", "reports", str(self.results)])

    @property
    def command(self) -> str:
        """The command that runs the cells again, with the methods unless they are the suite's."""
        seeds = ",".join(str(seed) for seed in sorted({row.seed for row in self.contents.rows}))
        cases = ",".join(self.contents.cases)
        named = [self.name] if self.name in SUITES else []
        ours = [label for label in self.contents.methods if label.method != SUBMITTED]
        if _methods_of(self.name) != {(label.method, label.params) for label in ours}:
            named += ["--methods", ",".join(map(_spec, ours))]
        run = ["python", "-m", "benchmarks", "run", *named]
        return shlex.join([*run, "--cases", cases, "--seeds", seeds, "--out", str(self.results)])

    @property
    def runs(self) -> list[dict[str, str]]:
        """The environments in which the cells ran, entry by entry."""
        used = {row.run for row in self.contents.rows}
        try:
            entries = self.contents.runs
        except InputError:
            return []
        return [
            {str(name): _told(value) for name, value in entry.items()}
            for number, entry in enumerate(entries)
            if number in used and isinstance(entry, Mapping)
        ]


def _methods_of(suite: str) -> set[tuple[str, str]]:
    """Name and parameters of each method that a suite names; none for a suite of a user's own."""
    if suite not in SUITES:
        return set()
    named = map(planning.parameters, SUITES[suite].methods)
    return {(name, json.dumps(values, sort_keys=True)) for name, values in named}


def _spec(label: Label) -> str:
    """A method with all its parameters, as `python -m benchmarks run --methods` takes it."""
    given = ", ".join(f"{name}={value!r}" for name, value in label.parameters.items())
    return f"{label.method}({given})" if given else label.method


def _told(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_told(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return ", ".join(_told(entry) for entry in value) or "none"
    return str(value)
