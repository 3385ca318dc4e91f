"""The figures of a report, each a function of the results: as PDF and PNG, with a caption.

All draw from the store and from the pictures of `reports.pictures`; one style, colours that the
colour-blind tell apart, and never colour alone.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from benchmarks.results import ResultRow
from reports.contents import Contents
from reports.galleries import cut_model, disks, heat_maps, is_cut, maps, models
from reports.pictures import known_keys, slug, source_hash
from reports.plots import area_convergence, convergence, cost, losses, pareto, singular_values
from reports.style import STYLE, lighten


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


def drawings(contents: Contents, pictures: Path) -> list[Drawing]:
    """All figures of a suite, the ones to look at first first."""
    checker = (
        "The checkerboard's fields have the same size in UV for all methods, whose UV area is "
        "scaled to that of the surface. Green: seams, and faces that span a learned seam; orange: "
        "flipped faces. UV layouts are coloured by the surface's normals, so that its parts can "
        "be told; faces that span a learned seam are left pale there and lie below the others."
    )
    whole = contents.rows

    def of_suite(name: str, title: str, caption: str, make: Callable[[], Figure | None]) -> Drawing:
        return Drawing(name, title, caption, whole, make)

    found = [
        of_suite(
            "models",
            "Test models",
            "The models from two sides, with their mesh edges.",
            partial(models, contents, pictures),
        ),
        of_suite(
            "disks",
            "SLIM and ParaPoint on the disks",
            f"The supplement's figure: the models that need no cut. {checker}",
            partial(disks, contents, pictures),
        ),
    ]
    for case in contents.cases:
        if is_cut(contents, case):
            rows = tuple(row for row in contents.rows if row.case == case)
            found.append(
                Drawing(
                    f"cut-{slug(case)}",
                    f"{case}: automatic cut and learned seam",
                    f"(a) The model, which is no disk. (b) SLIM on the automatic cut, which is "
                    f"the same for every method that needs one (the paper's was made by hand). "
                    f"(c) ParaPoint with the seam it learned. {checker}",
                    rows,
                    partial(cut_model, contents, case, pictures),
                )
            )
    found += [
        of_suite(
            "pareto",
            "Angles against areas",
            "Angle difference (over all faces) against area discrepancy; the grey steps join what "
            "no other method with one chart beats in both (hollow: many charts). A map may buy the "
            "one with the other.",
            partial(pareto, contents),
        ),
        of_suite(
            "convergence",
            "Angle distortion against time",
            "Angle difference over all faces along the way of every method that keeps a trace; a "
            "single marker is a method without one, at its end.",
            partial(convergence, contents),
        ),
        of_suite(
            "convergence-area",
            "Area distortion against time",
            "Area discrepancy over all faces along the way, as in the figure of the angles.",
            partial(area_convergence, contents),
        ),
        of_suite(
            "losses",
            "Losses of ParaPoint",
            "Loss terms of ParaPoint, as they enter the total, against iterations.",
            partial(losses, contents),
        ),
        of_suite(
            "singular-values",
            "Singular values",
            "Share of the surface's area by singular value of the map, both of them, UV area "
            "scaled to the surface's, faces that span a learned seam left out: an isometry is one "
            "peak at 1, a conformal map moves both values together.",
            partial(singular_values, contents),
        ),
        of_suite(
            "cost", "Time against size", "Wall time of each method against the number of faces.",
            partial(cost, contents),
        ),
    ]  # fmt: skip
    for case in contents.cases:
        rows = tuple(row for row in contents.rows if row.case == case)
        if any(row.status == "ok" for row in rows):
            found += [
                Drawing(
                    f"maps-{slug(case)}",
                    f"{case}: all methods",
                    f"All methods on {case}. {checker}",
                    rows,
                    partial(maps, contents, case, pictures),
                ),
                Drawing(
                    f"heat-{slug(case)}",
                    f"{case}: where the distortion is",
                    f"Distortion of the angles (stretch, the ratio of the singular values) and of "
                    f"the areas on {case}, on the surface and in UV, faces that span a learned "
                    "seam left out (grey on the surface).",
                    rows,
                    partial(heat_maps, contents, case, pictures),
                ),
            ]
    return found


@dataclass(frozen=True)
class Drawn:
    """A figure that lies in the folder."""

    name: str
    title: str
    caption: str


def draw(contents: Contents, pictures: Path, folder: Path, jobs: int) -> list[Drawn]:
    """Write the figures of a suite into `folder` as PDF and PNG, those that have changed.

    `captions.md` beside them says what each shows; `jobs` processes share the work.
    """
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "keys.json"
    known = known_keys(record)
    source = source_hash()
    keys, changed = {}, []
    planned = drawings(contents, pictures)
    for drawing in planned:
        states = [[row.id, row.status, row.uv_sha256, row.seconds] for row in drawing.rows]
        text = f"{source} {json.dumps(states)}"
        keys[drawing.name] = hashlib.sha256(text.encode()).hexdigest()[:16]
        if known.get(drawing.name) != keys[drawing.name]:
            changed.append(drawing)
    if jobs > 1 and len(changed) > 1:
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            list(pool.map(partial(write, folder), changed))
    else:
        for drawing in changed:
            write(folder, drawing)
    record.write_text(json.dumps(keys, indent=0, sort_keys=True) + "\n")
    drawn = [
        Drawn(one.name, one.title, one.caption)
        for one in planned
        if (folder / f"{one.name}.png").exists()
    ]
    captions = [f"## {one.name}\n\n**{one.title}.** {one.caption}\n" for one in drawn]
    (folder / "captions.md").write_text("\n".join(captions), encoding="utf-8")
    return drawn


def write(folder: Path, drawing: Drawing) -> None:
    """Write a figure as PDF and PNG; the same figure gives the same bytes."""
    files = [folder / f"{drawing.name}.{kind}" for kind in ("pdf", "png")]
    with mpl.rc_context(STYLE):
        made = drawing.figure()
        if made is None:
            for file in files:
                file.unlink(missing_ok=True)
            return
        made.savefig(files[1], metadata={"Title": drawing.title})
        lighten(made)
        made.savefig(files[0], metadata={"CreationDate": None, "Title": drawing.title})
