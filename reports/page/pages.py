"""The page: an index that opens from disk, and for each model a page with all its maps."""

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

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.colors import to_hex
from PIL import Image

from benchmarks.cases.suites import SUITES
from benchmarks.rendering.maps import ANGLE_SCALE, AREA_SCALE
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.surface import Mesh
from reports.contents import AREA, Contents, Label, number, suite_title
from reports.page import viewer
from reports.pictures import exports
from reports.pictures.figures import Drawn
from reports.pictures.names import VIEWED, map_file, model_file, slug
from reports.tables import leaderboard
from reports.tables.leaderboard import MEASURES, SHOWN, Glance, Winner, definition, page_of, winner
from reports.tables.published import published_values
from reports.tables.table import Table, grouped, metric_column

MODES = {
    "checker": "Checker",
    "normals": "Normals",
    "angle": "Angles",
    "area": "Areas",
    "seams": "Seams",
}
"""What the viewer can show, and how the buttons call it."""

SCALES = {
    "angle": ("stretch σ1/σ2", ANGLE_SCALE, ("1", "4 or more")),
    "area": ("UV area / 3D area", AREA_SCALE, ("1/8 or less", "8 or more")),
}
"""Title, colours and range, and the ends in words, of each distortion in the viewer."""

TILES = {"surface": "checker-1", "UV layout": "layout"}
POINT_TILES = {
    "points, by their normals": "cloud",
    "UV": "cloud-uv",
    "checkerboard": "dense",
    "where the map tears": "seams",
}
"""What is shown of a map of a mesh, and of one of points: the kinds of the pictures."""

ASSETS = ("style.css", "page.js", "viewer.js")
"""What all pages share."""


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
class Card:
    """What a model's page says of a method.

    Attributes:
        label: the method.
        row: its cell.
        detail: its parameters that are told.
        map: address of what the viewer reads, from the page; "" where there is none.
        pictures: addresses by what they show; of a mesh two, which the viewer takes the place of.
        numbers: the metrics of SHOWN.
        exports: name and address of its textured meshes, where they were written.
    """

    label: Label
    row: ResultRow
    detail: str
    map: str
    pictures: Mapping[str, str]
    numbers: Sequence[Number]
    exports: Sequence[tuple[str, str]]


def _spec(label: Label) -> str:
    """A method with all its parameters, as `python -m benchmarks run --methods` takes it."""
    given = ", ".join(f"{name}={value!r}" for name, value in label.parameters.items())
    return f"{label.method}({given})" if given else label.method


@dataclass(frozen=True)
class Section:
    """What the page says of a suite.

    Attributes:
        report: the folder of the report.
        contents: its cells.
        tables: the one to read first first.
        figures: those that were drawn.
        faults: what could not be drawn, and why.
    """

    report: Path
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
    def unfinished(self) -> list[ResultRow]:
        """The cells that did not end well."""
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
    def example(self) -> tuple[str, list[tuple[Label, str]]]:
        """A mesh and its picture under each method.

        One that most methods map; of these one of the paper, on which they differ most in areas.
        """
        shown = {
            case: [
                (label, address)
                for label in self.contents.methods
                if (row := self.contents.shown(case, label))
                and (address := self.picture(map_file(row, TILES["surface"])))
            ]
            for case in self.contents.cases
        }

        def worth(case: str) -> tuple[int, bool, float]:
            records = [self.contents.records.get((case, label.short)) for label, _ in shown[case]]
            areas = [area for one in records if (area := number(one, AREA)) is not None]
            spread = max(areas) - min(areas) if areas else 0.0
            return len(shown[case]), bool(published_values(case)), spread

        case = max(shown, key=worth)
        return case, shown[case]

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
        return "The model is not at hand."

    @property
    def command(self) -> str:
        """The command that runs the cells again; a suite of the user's own has no name for it."""
        seeds = ",".join(str(seed) for seed in sorted({row.seed for row in self.contents.rows}))
        cases = ",".join(self.contents.cases)
        named = [self.name]
        if self.name not in SUITES:
            named = ["--methods", ",".join(map(_spec, self.contents.methods))]
        run = ["python", "-m", "benchmarks", "run", *named]
        return shlex.join([*run, "--cases", cases, "--seeds", seeds])

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


def _told(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_told(entry)}" for name, entry in value.items())
    if isinstance(value, list):
        return ", ".join(_told(entry) for entry in value) or "none"
    return str(value)


def _params(label: Label) -> str:
    return json.dumps(label.parameters, ensure_ascii=False) if label.parameters else "none"


def _inline(content: object) -> Markup:
    """`content` as JSON within a script element: nothing in it can end the element."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704  # no < is left


def _templates() -> Environment:
    return Environment(
        loader=PackageLoader("reports.page"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def index(folder: Path, sections: Sequence[Section]) -> str:
    """The HTML of the index of the report on the results in `folder`."""
    return (
        _templates()
        .get_template("index.html")
        .render(
            sections=sections,
            folder=str(folder),
            report_command=shlex.join(["python", "-m", "reports", str(folder)]),
            cells=_inline(leaderboard.data([section.contents for section in sections])),
            grouped=grouped,
            definition=definition,
            measures={
                title: metric
                for title, metric in MEASURES.items()
                if any(title in section.glances for section in sections)
            },
            page_of=page_of,
            params=_params,
            metric_column=metric_column,
        )
    )


def model_page(section: Section, case: str) -> str:
    """The HTML of a model's page."""
    cases = section.contents.cases
    at = cases.index(case)
    pages = [(name, f"{slug(name)}.html") for name in cases]
    cards = section.cards(case)
    shape = section.picture(model_file(case, VIEWED)) if any(card.map for card in cards) else ""
    scales: dict[str, dict[str, Any]] = {
        name: {"title": title, "ends": ends, "colours": _colours(scale[0]), "range": scale[1:]}
        for name, (title, scale, ends) in SCALES.items()
    }
    faults = [fault for fault in section.faults if fault.startswith(case)]
    flat = "a cloud has pictures alone" if case in section.contents.clouds else ""
    return (
        _templates()
        .get_template("model.html")
        .render(
            section=section,
            case=case,
            about=section.about(case),
            pages=pages,
            before=pages[at - 1][1] if at else "",
            after=pages[at + 1][1] if at + 1 < len(pages) else "",
            modes=MODES.items(),
            scales=scales,
            shape=shape,
            fault="; ".join(faults) or flat or "no map of this model can be drawn",
            cards=cards,
            figures=section.figures_of(case),
            facts=_inline(
                {
                    "shape": f"../../{shape}" if shape else "",
                    "levels": viewer.LEVELS,
                    "sky": viewer.SKY_BITS,
                    "steepest": viewer.STEEPEST,
                    "scales": {name: scale["colours"] for name, scale in scales.items()},
                    "limits": {name: scale["range"] for name, scale in scales.items()},
                }
            ),
        )
    )


def _colours(name: str) -> list[str]:
    """33 colours of a colour map, which a browser joins linearly."""
    return [to_hex(colormaps[name](place / 32)) for place in range(33)]


def write(report: Path, folder: Path, sections: Sequence[Section]) -> Path:
    """Write the pages of a report, and what they share; the path of the index."""
    loader = Path(__file__).parent / "templates"
    for name in ASSETS:
        _put(report / "assets" / name, (loader / name).read_text(encoding="utf-8"))
    for section in sections:
        for case in section.contents.cases:
            _put(report / page_of(section.contents, case), model_page(section, case))
    return _put(report / "index.html", index(folder, sections))


def _put(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path
