"""The figures that are made of pictures: models, and maps on them and in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from benchmarks.cases.derived import is_drawn
from benchmarks.rendering.maps import ANGLE_SCALE, AREA_SCALE
from benchmarks.store.rows import ResultRow
from parapoint.surfaces.preparation import CUT
from reports.contents import (
    ANGLE,
    AREA,
    FLIPPED,
    POINT_ANGLE,
    POINT_AREA,
    POINT_COLLISIONS,
    POINT_TEARS,
    SPANNING,
    Contents,
)
from reports.labels import Label
from reports.pictures.names import ARTIST_PICTURES, CLOUD_PICTURES, map_file, model_file
from reports.pictures.style import WIDTH, figure, picture_grid, put, wrapped
from reports.tables.table import metric_column

LETTER = 0.065
"""Width of a letter above a column, in inches, at most."""


def leading(contents: Contents, method: str) -> Label | None:
    """The parameters of a method that the supplement's figures show.

    SLIM's isometric energy, fully iterated; of others, those with most models done.
    """
    found = [label for label in contents.methods if label.method == method]
    if method == "slim":
        isometric = [
            label for label in found if label.parameters.get("energy") == "symmetric_dirichlet"
        ]
        found = isometric or found

    def worth(label: Label) -> tuple[int, float]:
        done = sum(contents.shown(case, label) is not None for case in contents.cases)
        return done, float(label.parameters.get("iterations") or 0)

    return max(found, key=worth, default=None)


def values_text(contents: Contents, row: ResultRow) -> str:
    """Angle, area and flips of a cell in a few lines, as they stand below its pictures."""
    cells = contents.measured[contents.measured["id"] == row.id]
    if cells.empty:
        return ""
    of_points = row.case in contents.clouds
    metrics = (POINT_ANGLE, POINT_AREA) if of_points else (ANGLE, AREA)
    names = ("stretch", "area") if of_points else ("angle", "area")
    faults = (
        {"tears": POINT_TEARS, "collisions": POINT_COLLISIONS}
        if of_points
        else {"flipped": FLIPPED, "spanning": SPANNING}
    )
    values = {name: float(cells.iloc[0][name]) for name in (*metrics, *faults.values())}
    if not np.isfinite([values[name] for name in metrics]).all():
        return "no finite values"
    shown = {name: metric_column(name).shown(value) for name, value in values.items()}
    lines = ["   ".join(f"{name} {shown[of]}" for name, of in zip(names, metrics, strict=True))]
    extra = [f"{name} {shown[of]} %" for name, of in faults.items() if values[of] > 0]
    return "\n".join([*lines, *(["   ".join(extra)] if extra else [])])


def pictures_of(
    contents: Contents, case: str, label: Label, kinds: Sequence[str], pictures: Path
) -> list[Path | str]:
    """The pictures of a cell, or why there are none."""
    row = contents.shown(case, label)
    if row is not None:
        return [pictures / map_file(row, kind) for kind in kinds]
    rows = contents.cell(case, label)
    said = rows[0].status.replace("_", " ") if rows else "not run"
    return [said, *[""] * (len(kinds) - 1)]


def models(contents: Contents, pictures: Path, cases: Sequence[str]) -> Figure:
    """The test models from two sides, meshes with their edges."""
    across = min(3, len(cases))
    down = -(-len(cases) // across)
    side, gap, foot = (WIDTH - 0.2) / 6, 0.02, 0.34
    height = down * (side + foot)
    width = across * (2 * (side + gap) + 0.06)
    made = figure(width, height)
    for number, case in enumerate(cases):
        x0 = (number % across) * (2 * (side + gap) + 0.06)
        y0 = height - (number // across + 1) * (side + foot) + foot
        for at, kind in enumerate(("mesh-1", "mesh-2")):
            x = x0 + at * (side + gap)
            box = (x / width, y0 / height, side / width, side / height)
            put(made, box, pictures / model_file(case, kind))
        surface = contents.mesh(case)
        if surface is not None:
            size = f"{len(surface.faces):,} faces, {surface.topology}"
        else:
            size = "a cloud of points" if case in contents.clouds else "could not be had"
        middle = (x0 + side + gap / 2) / width
        made.text(middle, (y0 - 0.04) / height, case, ha="center", va="top", fontsize=8.5)
        made.text(
            middle, (y0 - 0.17) / height, size, ha="center", va="top", fontsize=7, color="0.35"
        )
    return made


def is_cut(contents: Contents, case: str) -> bool:
    """Whether some method got the model with an automatic cut."""
    return any(CUT in row.preprocessing for row in contents.rows if row.case == case)


def leaves_out(contents: Contents, case: str) -> bool:
    """Whether some map leaves out a part of the model."""
    own = contents.measured[contents.measured["case"] == case]
    return bool((own["coverage"] < 1).any())


def disks(contents: Contents, pictures: Path, cases: Sequence[str]) -> Figure | None:
    """The supplement's figure: SLIM and ParaPoint on models that need no cut."""
    pair = [leading(contents, "slim"), leading(contents, "parapoint")]
    chosen = [label for label in pair if label is not None]
    if not chosen:
        return None
    kinds = ("layout", "checker-1", "checker-2")
    heads = [f"{label.name}: {kind}" for label in chosen for kind in ("UV", "view 1", "view 2")]
    rows = []
    for case in cases:
        found: list[Path | str] = []
        lines = []
        for label in chosen:
            found += pictures_of(contents, case, label, kinds, pictures)
            row = contents.shown(case, label)
            if row is not None:
                lines.append(f"{label.name}\n{values_text(contents, row)}")
        rows.append((wrapped(case, 26), "\n".join(lines), found))
    side = (WIDTH - 1.5) / 3 if len(chosen) == 1 else 1.05
    return picture_grid(heads, rows, side=side, left=1.5)


def clouds(contents: Contents, pictures: Path, cases: Sequence[str]) -> Figure | None:
    """The paper's figure: cloud, uv, texture on dense points and learned seams of ParaPoint."""
    label = leading(contents, "parapoint")
    if label is None or not any(contents.shown(case, label) for case in cases):
        return None
    heads = ["(a) cloud", "(b) UV", "(c) texture", "(d) learned seams"]
    rows = []
    for case in cases:
        row = contents.shown(case, label)
        values = values_text(contents, row) if row else ""
        shown = pictures_of(contents, case, label, CLOUD_PICTURES, pictures)
        rows.append((wrapped(case), values, shown))
    return picture_grid(heads, rows, side=1.33, left=1.5)


def cut_model(contents: Contents, case: str, pictures: Path) -> Figure | None:
    """Nefertiti's figure: the model, the artist's cut if known, SLIM's automatic, the learned."""
    pair = [leading(contents, "slim"), leading(contents, "parapoint")]
    chosen = [label for label in pair if label is not None]
    artist = [pictures / model_file(case, kind) for kind in ARTIST_PICTURES]
    panels: list[tuple[str, str, Sequence[Path | str]]] = []
    if all(path.exists() for path in artist):
        panels.append(("hand-made: the artist's map", "", artist))
    for label in chosen:
        row = contents.shown(case, label)
        learned = "learned seam" if label.method == "parapoint" else "uncut"
        was_cut = CUT in row.preprocessing if row else learned == "uncut" and is_cut(contents, case)
        cut = "automatic cut" if was_cut else "drawn seam" if is_drawn(case) else learned
        # A seam that somebody draws is where the front does not show it.
        view = "checker-2" if is_drawn(case) else "checker-1"
        shown = pictures_of(contents, case, label, (view, "layout"), pictures)
        text = values_text(contents, row) if row else ""
        panels.append((f"{label.name}, {cut}", text, shown))
    if not panels:
        return None
    side, foot = WIDTH / (1 + 2 * len(panels)) - 0.04, 0.62
    made = figure(WIDTH, side + foot)
    shown_all = [pictures / model_file(case, "mesh-1"), *(p for panel in panels for p in panel[2])]
    for number, picture in enumerate(shown_all):
        x = number * (side + 0.04) / WIDTH
        box = (x, foot / (side + foot), side / WIDTH, side / (side + foot))
        put(made, box, picture)
    name = wrapped(f"(a) {case.replace('_', ' ').replace('-', ' ')}", 20)
    top, below = 0.5 / (side + foot), 0.32 / (side + foot)
    made.text(side / 2 / WIDTH, top, name, ha="center", va="top", fontsize=8)
    for number, (head, text, _) in enumerate(panels):
        x = ((1 + 2 * number) * (side + 0.04) + side + 0.02) / WIDTH
        made.text(x, top, f"({'bcd'[number]}) {head}", ha="center", va="top", fontsize=8)
        made.text(x, below, text, ha="center", va="top", fontsize=7, color="0.3")
    return made


def ablation(contents: Contents, pictures: Path, cases: Sequence[str]) -> Figure:
    """Variants of one method side by side: the UV layout above the texture, model by model."""
    labels = contents.methods
    gap, left, top, foot = 0.06, 0.75, 0.42, 0.34
    side = (WIDTH - left) / len(labels) - gap
    height = top + len(cases) * (2 * side + foot)
    made = figure(WIDTH, height)
    for column, label in enumerate(labels):
        x = left + column * (side + gap)
        words = wrapped(label.short.removeprefix(f"{label.name} "), round(side / LETTER))
        words = "unchanged" if label.short == label.name else words
        made.text(
            (x + side / 2) / WIDTH, 1 - 0.05 / height, words, ha="center", va="top", fontsize=6.5
        )
        for number, case in enumerate(cases):
            y = height - top - number * (2 * side + foot)
            shown = pictures_of(contents, case, label, ("layout", "checker-1"), pictures)
            for down, picture in enumerate(shown, start=1):
                box = (x / WIDTH, (y - down * side) / height, side / WIDTH, side / height)
                put(made, box, picture)
            row = contents.shown(case, label)
            made.text(
                (x + side / 2) / WIDTH,
                (y - 2 * side - 0.02) / height,
                values_text(contents, row).replace("   ", " ") if row else "",
                ha="center",
                va="top",
                fontsize=6.5,
                color="0.3",
            )
    for number, case in enumerate(cases):
        y = height - top - number * (2 * side + foot) - side
        made.text(0.04 / WIDTH, y / height, wrapped(case, 10), va="center", fontsize=8.5)
    return made


def ablation_of_the_paper(contents: Contents, pictures: Path) -> Figure | None:
    """The paper's four: the cube under both distortion terms, the eight under either branch."""
    wanted = (
        ("cube", "conformal", {"distortion": None, "branches": None, "distortion_weight": None}),
        ("cube", "isometric", {"distortion": "isometric"}),
        ("eight", "2D→3D→2D alone", {"branches": "2d"}),
        ("eight", "3D→2D→3D alone", {"branches": "3d"}),
    )
    panels: list[tuple[str, list[Path | str]]] = []
    for model, words, changes in wanted:
        case = next((case for case in contents.cases if case.startswith(model)), None)
        label = next(
            (
                label
                for label in contents.methods
                if all(label.parameters.get(name) == value for name, value in changes.items())
            ),
            None,
        )
        if case is None or label is None:
            return None
        shown = pictures_of(contents, case, label, ("layout", "checker-1"), pictures)
        panels.append((f"({'abcd'[len(panels)]}) {model}, {words}", shown))
    side, gap, foot = (WIDTH - 0.3) / 4, 0.1, 0.3
    height = 2 * side + foot
    made = figure(WIDTH, height)
    for column, (words, shown) in enumerate(panels):
        x = column * (side + gap)
        for down, picture in enumerate(shown, start=1):
            box = (x / WIDTH, (height - down * side) / height, side / WIDTH, side / height)
            put(made, box, picture)
        made.text((x + side / 2) / WIDTH, 0.2 / height, words, ha="center", va="top", fontsize=8)
    return made


def maps(contents: Contents, case: str, pictures: Path) -> Figure:
    """Every method on one model: UV layout and checkerboard from two sides; of a cloud, points."""
    kinds, heads = ("layout", "checker-1", "checker-2"), ["UV layout", "view 1", "view 2"]
    if case in contents.clouds:
        kinds, heads = ("cloud-uv", "dense", "seams"), ["UV", "texture", "where it tears"]
    rows = [
        (
            wrapped(label.short),
            values_text(contents, row) if (row := contents.shown(case, label)) else "",
            pictures_of(contents, case, label, kinds, pictures),
        )
        for label in contents.methods
    ]
    return picture_grid(heads, rows, side=1.5, left=1.4)


def heat_maps(contents: Contents, case: str, pictures: Path) -> Figure:
    """Angle and area distortion of every method on one model, on the surface and in the plane."""
    kinds = ("angle", "angle-uv", "area", "area-uv")
    rows = [
        (wrapped(label.short), "", pictures_of(contents, case, label, kinds, pictures))
        for label in contents.methods
    ]
    side, left, bottom = 1.3, 1.2, 0.62
    made = picture_grid(
        ["angles, surface", "angles, UV", "areas, surface", "areas, UV"],
        rows,
        side=side,
        left=left,
        bottom=bottom,
    )
    width, height = made.get_size_inches()
    for number, (scale, title, ticks) in enumerate(
        (
            (ANGLE_SCALE, "stretch σ1/σ2", ("1", "2", "4 or more")),
            (AREA_SCALE, "UV area / 3D area", ("1/8 or less", "1", "8 or more")),
        )
    ):
        name, low, high = scale
        x = left + number * 2 * (side + 0.06) + 0.25
        place = made.add_axes((x / width, 0.36 / height, (2 * side - 0.5) / width, 0.09 / height))
        bar = made.colorbar(
            ScalarMappable(Normalize(low, high), name), cax=place, orientation="horizontal"
        )
        bar.set_ticks([low, (low + high) / 2, high], labels=list(ticks))
        bar.outline.set_linewidth(0.4)
        place.set_title(title, fontsize=8, pad=2)
    return made
