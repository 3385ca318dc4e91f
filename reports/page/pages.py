"""The page: an index that opens from disk, and for each model a page with all its maps."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.colors import to_hex

from benchmarks.commands.listing import credit
from benchmarks.metrics.grades import BOUNDS
from benchmarks.rendering.maps import ANGLE_SCALE, AREA_SCALE
from parapoint.files.targets import write_text
from reports.labels import Label
from reports.page import board, viewer
from reports.page.sections import Section
from reports.pictures.galleries import leaves_out
from reports.pictures.names import VIEWED, model_file, slug
from reports.tables.leaderboard import MEASURES, definition, page_of
from reports.tables.table import grouped, metric_column

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

ASSETS = ("style.css", "page.js", "unpack.js", "shaders.js", "viewer.js")
"""What all pages share."""


def _params(label: Label) -> str:
    return json.dumps(label.parameters, ensure_ascii=False) if label.parameters else "none"


def _inline(content: object) -> Markup:
    """`content` as JSON within a script element: nothing in it can end the element."""
    text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c"))  # noqa: S704  # no < is left


@functools.cache
def _templates() -> Environment:
    """The templates of all pages, each compiled once."""
    return Environment(
        loader=PackageLoader("reports.page"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


Links = Sequence[tuple[str, str]]
"""Title and address of pages beside the index: of a site, those of its methods and of its history.
"""


def index(folder: str, sections: Sequence[Section], links: Links = ()) -> str:
    """The HTML of the index of a report on the results in `folder`, or of a site, with `links`."""
    return (
        _templates()
        .get_template("index.html")
        .render(
            sections=sections,
            folder=folder,
            links=links,
            licence=lambda label: credit(label.method)[0],
            cells=_inline(board.data([section.contents for section in sections])),
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
            bounds=BOUNDS,
            about=section.about(case),
            leaves_out=leaves_out(section.contents, case),
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


def method_page(
    label: Label, about: Sequence[str], heads: Sequence[str], lines: Sequence[object]
) -> str:
    """The HTML of a method's page: what it is, and a line for each model.

    Args:
        label: the method.
        about: what there is to say of it, line by line.
        heads: of the metrics.
        lines: as `reports.site.methods.Line`.
    """
    template = _templates().get_template("method.html")
    return template.render(label=label, about=about, heads=heads, lines=lines, params=_params)


def _colours(name: str) -> list[str]:
    """33 colours of a colour map, which a browser joins linearly."""
    return [to_hex(colormaps[name](place / 32)) for place in range(33)]


def write(report: Path, folder: str, sections: Sequence[Section], links: Links = ()) -> Path:
    """Write the pages of a report, and what they share; the path of the index."""
    loader = Path(__file__).parent / "templates"
    for name in ASSETS:
        put(report / "assets" / name, (loader / name).read_text(encoding="utf-8"))
    for section in sections:
        for case in section.contents.cases:
            put(report / page_of(section.contents, case), model_page(section, case))
    return put(report / "index.html", index(folder, sections, links))


def put(path: Path, text: str) -> Path:
    """Write a page, and the folders above it; its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, text)
    return path
