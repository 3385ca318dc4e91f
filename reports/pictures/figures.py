"""The figures of a report, each a function of the results: as PDF and PNG, with a caption.

All draw from the store and from the pictures of `reports.pictures.drawing`; one style, colours that
the colour-blind tell apart, and never colour alone.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from benchmarks.cases.derived import is_drawn
from benchmarks.store.rows import ResultRow
from parapoint.files.targets import complete_file, write_text
from parapoint.sources import source_hash
from reports.contents import ANGLE, AREA, FLIPPED_OFF_SEAM, SHEETS, Contents
from reports.pictures.clouds import DENSE, SPARSE, points_used
from reports.pictures.drawing import known_keys
from reports.pictures.galleries import (
    ablation,
    ablation_of_the_paper,
    clouds,
    cut_model,
    disks,
    heat_maps,
    is_cut,
    leading,
    leaves_out,
    maps,
    models,
)
from reports.pictures.names import slug
from reports.pictures.plots import (
    LEAST_SIZES,
    convergence,
    cost,
    losses,
    pareto,
    seams,
    singular_values,
)
from reports.pictures.printing import few_colours, light, on_white
from reports.pictures.style import DARK_PAPER, STYLE, darken
from reports.pictures.workers import done_by_several
from reports.progress import QUIET, Progress
from reports.tables.published import published_values


@dataclass(frozen=True)
class Drawing:
    """A figure to be made.

    Attributes:
        name: of its files.
        title: one line.
        caption: what it shows and how to read it.
        rows: what it is drawn from.
        figure: makes it; None where there is nothing to show.
    """

    name: str
    title: str
    caption: str
    rows: tuple[ResultRow, ...]
    figure: Callable[[], Figure | None]


ENDINGS = (".pdf", ".png", "-dark.png")
"""What the files of a figure end in: for print, for light pages, for dark ones."""

MODELS, ROWS, PANELS = 12, 7, 9
"""Models on a page of models, of rows of pictures, of plots."""


def paged(
    contents: Contents,
    name: str,
    title: str,
    caption: str,
    *,
    make: Callable[[Sequence[str]], Figure | None],
    cases: Sequence[str],
    size: int,
    methods: Container[str] | None = None,
) -> list[Drawing]:
    """A figure of `cases`, or several of `size` of them each: none is longer than a page.

    It shows maps of `methods`, or of all; a model's first row stands for the model itself.
    """
    first = {row.case: row for row in reversed(contents.rows)}
    first |= {row.case: row for row in reversed(contents.rows) if row.surface_hash}
    parts = [cases[at : at + size] for at in range(0, len(cases), size)]
    return [
        Drawing(
            f"{name}-{number}" if number > 1 else name,
            f"{title}, {number} of {len(parts)}" if len(parts) > 1 else title,
            caption,
            tuple(
                row
                for row in contents.rows
                if row.case in part
                and (methods is None or row.method in methods or row == first[row.case])
            ),
            partial(make, part),
        )
        for number, part in enumerate(parts, start=1)
    ]


def drawings(contents: Contents, pictures: Path) -> list[Drawing]:
    """All figures of a suite, in the order in which to look at them."""
    checker = (
        "The checkerboard's fields have the same size in UV for all methods, whose UV area is "
        "scaled to that of the surface. Green: seams, and faces that span a learned seam; orange: "
        "flipped faces. UV layouts are coloured by the surface's normals, so that its parts can "
        "be told; faces that span a learned seam are left pale there and lie below the others."
    )
    cases = contents.cases
    if any(leaves_out(contents, case) for case in cases):
        checker += " Grey: faces that a map leaves out."
    meshes = [case for case in cases if case not in contents.clouds]
    whole = [case for case in meshes if not is_cut(contents, case)]
    several = partial(paged, contents)
    sheets = [] if contents.is_large else cases
    told = [case for case in cases if case in sheets or published_values(case)]
    as_points = [case for case in cases if case in told or case in contents.clouds]

    found = [
        *several(
            "models",
            "Test models",
            "The models from two sides, meshes with their edges.",
            make=partial(models, contents, pictures),
            cases=cases,
            size=MODELS,
            methods=(),
        ),
        *several(
            "disks",
            "SLIM and ParaPoint on the disks",
            f"The supplement's figure: the models that need no cut. {checker}",
            make=partial(disks, contents, pictures),
            cases=whole,
            size=ROWS,
            methods=("slim", "parapoint"),
        ),
        *several(
            "clouds",
            "ParaPoint from points",
            f"The paper's figure. (a) Points of the surface, as many as ParaPoint was given "
            f"({points_told(contents)}), coloured by the true normals, which it was not given. "
            f"(b) Their uv, in the same colours. (c) The checkerboard on {DENSE:,} points, those "
            "of flipped faces in orange. (d) Green: points of the faces that span a learned seam. "
            "The uv of a point is interpolated in its face, or is that of the nearest corner where "
            "the face spans a seam: the results hold no network that could be asked."
            + (
                f" Of more than {SHEETS} models, those of the paper are shown."
                if not sheets
                else ""
            )
            + (
                " Where the model is a cloud itself, (c) shows its own points as disks, and (d) "
                "those where the map tears between neighbours."
                if contents.clouds
                else ""
            ),
            make=partial(clouds, contents, pictures),
            cases=as_points,
            size=ROWS,
            methods=("parapoint",),
        ),
    ]
    if len(contents.methods) > 1 and len({label.method for label in contents.methods}) == 1:
        found += [
            *several(
                "ablation",
                f"Ablation of {contents.methods[0].name}",
                f"One change at a time: UV layout above, texture below. {checker}",
                make=partial(ablation, contents, pictures),
                cases=cases,
                size=3,
            ),
            Drawing(
                "ablation-paper",
                "The paper's ablation",
                "(a) The cube under the conformal and (b) under the isometric term; (c) the eight "
                "with the 2D→3D→2D branch alone and (d) with the 3D→2D→3D branch alone. UV layout "
                f"above, texture below. {checker}",
                contents.rows,
                partial(ablation_of_the_paper, contents, pictures),
            ),
        ]
    for case in told:
        rows = tuple(row for row in contents.rows if row.case == case)
        if is_cut(contents, case) or contents.has_artist(case) or is_drawn(case):
            found.append(
                Drawing(
                    f"cut-{slug(case)}",
                    f"{case}: hand-made, automatic and learned cut",
                    "The model; the artist's own map, where the file has one; SLIM on the "
                    "automatic cut, the same for every method that needs one, or along the seam "
                    "that we drew by hand (that of the paper's nefertiti is not public); ParaPoint "
                    f"with the seam it learned. {checker}",
                    rows,
                    partial(cut_model, contents, case, pictures),
                )
            )
    found += [
        *several(
            "pareto",
            "Angles against areas",
            "Angle difference (over all faces) against area discrepancy; the grey steps join what "
            "no other method with one chart beats in both. Hollow: many charts, or a part of the "
            "surface; pale: broken or collapsed, so not on the steps. A map may buy the one with "
            "the other.",
            make=partial(pareto, contents),
            cases=cases,
            size=PANELS,
        ),
        *several(
            "seams",
            "Energy against seams",
            "Symmetric Dirichlet energy (4 for an isometry; 20 stands for all above) against the "
            "length of the seam over the root of the area, of each model that some map cuts. "
            "Hollow: many charts, or a part of the surface; pale: broken or collapsed. A longer "
            "seam buys less distortion.",
            make=partial(seams, contents),
            cases=meshes,
            size=PANELS,
        ),
        *several(
            "convergence",
            "Angle distortion against time",
            "Angle difference over all faces along the way of every method that keeps a trace, a "
            "line for each seed; a single marker is a method without one, at its end.",
            make=partial(convergence, contents, pictures, metric=ANGLE),
            cases=cases,
            size=PANELS,
        ),
        *several(
            "convergence-area",
            "Area distortion against time",
            "Area discrepancy over all faces along the way, as in the figure of the angles.",
            make=partial(convergence, contents, pictures, metric=AREA),
            cases=cases,
            size=PANELS,
        ),
        *several(
            "convergence-flips",
            "Flipped faces against time",
            "Share of flipped faces, of those that span no seam, along the way, as in the figure "
            "of the angles.",
            make=partial(convergence, contents, pictures, metric=FLIPPED_OFF_SEAM),
            cases=cases,
            size=PANELS,
        ),
        *several(
            "losses",
            "Losses of ParaPoint",
            "Loss terms of ParaPoint, each without its weight, and their weighted total, against "
            "iterations: means since the point before.",
            make=partial(losses, contents),
            cases=cases,
            size=PANELS,
            methods=("parapoint",),
        ),
        *several(
            "singular-values",
            "Singular values",
            "How the surface's area is distributed over the singular values of the map, UV area "
            "scaled to the surface's, faces that span a learned seam left out: the larger filled, "
            "the smaller as a line, heights relative to the higher peak of each row. An isometry "
            "is one peak at 1; a conformal map moves both together.",
            make=partial(singular_values, contents, pictures),
            cases=meshes,
            size=PANELS,
        ),
        Drawing(
            "cost",
            "Time against size",
            "Wall time of each method against the number of faces, model by model; the lines are "
            f"the power laws that fit best, where a method has {LEAST_SIZES} sizes or more.",
            contents.rows,
            partial(cost, contents),
        ),
    ]
    for case in sheets:
        rows = tuple(row for row in contents.rows if row.case == case)
        if not any(row.status == "ok" for row in rows):
            continue
        found.append(
            Drawing(
                f"maps-{slug(case)}",
                f"{case}: all methods",
                f"All methods on {case}. {checker}",
                rows,
                partial(maps, contents, case, pictures),
            )
        )
        if case in meshes:
            found.append(
                Drawing(
                    f"heat-{slug(case)}",
                    f"{case}: where the distortion is",
                    f"Distortion of the angles (stretch, the ratio of the singular values) and of "
                    f"the areas on {case}, on the surface and in UV, faces that span a learned "
                    "seam left out (grey on the surface).",
                    rows,
                    partial(heat_maps, contents, case, pictures),
                )
            )
    return found


def points_told(contents: Contents) -> str:
    """How many points ParaPoint was given, "2,048" or "500 to 10,000", and in which budget."""
    label = leading(contents, "parapoint")
    rows = [row for row in contents.rows if label and contents.labels[row.id] == label]
    counts = sorted(points_used(row) for row in rows if row.status == "ok") or [SPARSE]
    told = " to ".join(f"{count:,}" for count in dict.fromkeys([counts[0], counts[-1]]))
    parts = label.detail.split(", ") if label and label.detail else []
    budget = [part for part in parts if "points" not in part]
    return "; ".join([told, *([", ".join(budget)] if budget else [])])


@dataclass(frozen=True)
class Drawn:
    """A figure that lies in the folder."""

    name: str
    title: str
    caption: str


def draw(
    contents: Contents, pictures: Path, folder: Path, jobs: int, progress: Progress = QUIET
) -> list[Drawn]:
    """Write the figures of a suite into `folder` as PDF and PNG, those that have changed.

    `captions.md` beside them says what each shows; `jobs` processes share the work, and
    `progress` hears of it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "keys.json"
    known = known_keys(record)
    source = source_hash(__name__)
    keys, changed = {}, []
    planned = drawings(contents, pictures)
    for drawing in planned:
        states = [[row.id, row.status, row.uv_sha256, row.seconds] for row in drawing.rows]
        text = f"{source} {contents.is_large} {json.dumps(states)}"
        keys[drawing.name] = hashlib.sha256(text.encode()).hexdigest()[:16]
        if known.get(drawing.name) != keys[drawing.name]:
            changed.append(drawing)
    make = partial(write, folder, contents.is_large)
    made = done_by_several(make, [(drawing,) for drawing in changed], jobs)
    list(progress.track(made, f"{contents.suite}: figures", len(changed)))
    write_text(record, json.dumps(keys, indent=0, sort_keys=True) + "\n")
    for name in known.keys() - keys.keys():  # of a folder that grew
        for ending in ENDINGS:
            (folder / f"{name}{ending}").unlink(missing_ok=True)
    drawn = [
        Drawn(one.name, one.title, one.caption)
        for one in planned
        if (folder / f"{one.name}.png").exists()
    ]
    captions = [f"## {one.name}\n\n**{one.title}.** {one.caption}\n" for one in drawn]
    write_text(folder / "captions.md", "\n".join(captions))
    return drawn


def write(folder: Path, coarse: bool, drawing: Drawing) -> None:
    """Write a figure as PDF, as PNG, and as PNG for dark pages; the same figure, the same bytes.

    Sheets of many pictures, and all figures if `coarse`, are not as fine: they are most of the
    weight.
    """
    files = [folder / f"{drawing.name}{ending}" for ending in ENDINGS]
    sheet = coarse or drawing.name.startswith(("maps-", "heat-"))
    with mpl.rc_context(STYLE | {"savefig.dpi": STYLE["savefig.dpi"] * (0.7 if sheet else 1.0)}):
        made = drawing.figure()
        if made is None:
            for file in files:
                file.unlink(missing_ok=True)
            return
        document, bright, dark = files
        few_colours(made, "white", bright)
        pictures = [shown for place in made.axes for shown in place.images]
        as_shown = [shown.get_array() for shown in pictures]
        for shown in pictures:
            shown.set_interpolation("none")  # as it is, at the size it is printed
            shown.set_data(on_white(shown.get_array()))
        content = io.BytesIO()
        with mpl.rc_context({"pdf.compression": 0} if pictures else {}):
            facts = {"CreationDate": None, "Title": drawing.title}
            made.savefig(content, format="pdf", metadata=facts)
        with complete_file(document) as stream:
            stream.write(light(content) if pictures else content.getvalue())
        for shown, picture in zip(pictures, as_shown, strict=True):
            shown.set_interpolation("antialiased")
            shown.set_data(picture)
        darken(made)
        few_colours(made, DARK_PAPER, dark)
