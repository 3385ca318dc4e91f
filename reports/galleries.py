"""The figures that are made of pictures: models, and maps on them and in the plane."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from benchmarks.results import ResultRow
from reports.contents import ANGLE, AREA, FLIPPED, Contents, Label
from reports.pictures import ANGLE_SCALE, AREA_SCALE, map_file, model_file
from reports.style import WIDTH, figure, note, picture_grid, put, wrapped


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
    """Angle, area and flips of a cell in a line or two, as they stand below its pictures."""
    cells = contents.measured[contents.measured["id"] == row.id]
    if cells.empty:
        return ""
    cell = cells.iloc[0]
    if not np.isfinite(cell[[ANGLE, AREA, FLIPPED]].to_numpy(dtype=float)).all():
        return "no finite values"
    lines = [f"angle {cell[ANGLE]:.3f}   area {cell[AREA]:.2f}"]
    extra = [f"flipped {100 * cell[FLIPPED]:.2g}%"] if cell[FLIPPED] > 0 else []
    if cell["spanning_fraction"] > 0:
        extra.append(f"spanning {100 * cell['spanning_fraction']:.2g}%")
    return "\n".join([*lines, "   ".join(extra)]) if extra else lines[0]


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


def models(contents: Contents, pictures: Path) -> Figure:
    """The test models from two sides with their mesh edges."""
    across = 3 if len(contents.cases) > 2 else len(contents.cases)
    down = -(-len(contents.cases) // across)
    side, gap, foot = (WIDTH - 0.2) / 6, 0.02, 0.34
    height = down * (side + foot)
    width = across * (2 * (side + gap) + 0.06)
    made = figure(width, height)
    for number, case in enumerate(contents.cases):
        x0 = (number % across) * (2 * (side + gap) + 0.06)
        y0 = height - (number // across + 1) * (side + foot) + foot
        for at, kind in enumerate(("mesh-1", "mesh-2")):
            x = x0 + at * (side + gap)
            put(
                made.add_axes((x / width, y0 / height, side / width, side / height)),
                pictures / model_file(case, kind),
            )
        surface = contents.mesh(case)
        size = f"{len(surface.faces):,} faces, {surface.topology}" if surface else "not at hand"
        middle = (x0 + side + gap / 2) / width
        made.text(middle, (y0 - 0.04) / height, case, ha="center", va="top", fontsize=8.5)
        made.text(
            middle, (y0 - 0.17) / height, size, ha="center", va="top", fontsize=7, color="0.35"
        )
    return made


def is_cut(contents: Contents, case: str) -> bool:
    """Whether some method got the model with an automatic cut."""
    return any(row.preprocessing for row in contents.rows if row.case == case)


def disks(contents: Contents, pictures: Path) -> Figure | None:
    """The supplement's figure: SLIM and ParaPoint on every model that needs no cut."""
    pair = [leading(contents, "slim"), leading(contents, "parapoint")]
    chosen = [label for label in pair if label is not None]
    cases = [case for case in contents.cases if not is_cut(contents, case)]
    if not chosen or not cases:
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
        rows.append((wrapped(case, 18), "\n".join(lines), found))
    return picture_grid(heads, rows, side=(WIDTH - 1.3) / 3 if len(chosen) == 1 else 1.05)


def cut_model(contents: Contents, case: str, pictures: Path) -> Figure | None:
    """Nefertiti's figure: the model, SLIM with the automatic cut, ParaPoint with its own seam."""
    pair = [leading(contents, "slim"), leading(contents, "parapoint")]
    chosen = [label for label in pair if label is not None]
    if not chosen:
        return None
    side, foot = WIDTH / (1 + 2 * len(chosen)) - 0.04, 0.62
    made = figure(WIDTH, side + foot)
    shown: list[tuple[Path | str, str]] = [(pictures / model_file(case, "mesh-1"), "")]
    for label in chosen:
        shown += [
            (picture, "")
            for picture in pictures_of(contents, case, label, ("checker-1", "layout"), pictures)
        ]
    for number, (picture, _) in enumerate(shown):
        x = number * (side + 0.04) / WIDTH
        place = made.add_axes((x, foot / (side + foot), side / WIDTH, side / (side + foot)))
        if isinstance(picture, Path):
            put(place, picture)
        else:
            note(place, picture)
    name = wrapped(f"(a) {case.replace('_', ' ').replace('-', ' ')}", 22)
    made.text(side / 2 / WIDTH, 0.5 / (side + foot), name, ha="center", va="top")
    for number, label in enumerate(chosen):
        row = contents.shown(case, label)
        x = ((1 + 2 * number) * (side + 0.04) + side + 0.02) / WIDTH
        cut = "automatic cut" if row is not None and row.preprocessing else "learned seam"
        head = f"({'bc'[number]}) {label.name}, {cut}"
        made.text(x, 0.5 / (side + foot), head, ha="center", va="top")
        if row is not None:
            text = values_text(contents, row)
            made.text(
                x, 0.32 / (side + foot), text, ha="center", va="top", fontsize=7.5, color="0.3"
            )
    return made


def maps(contents: Contents, case: str, pictures: Path) -> Figure:
    """Every method on one model: UV layout and checkerboard from two sides."""
    kinds = ("layout", "checker-1", "checker-2")
    rows = [
        (
            wrapped(label.short),
            values_text(contents, row) if (row := contents.shown(case, label)) else "",
            pictures_of(contents, case, label, kinds, pictures),
        )
        for label in contents.methods
    ]
    return picture_grid(["UV layout", "view 1", "view 2"], rows, side=1.5, left=1.4)


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
            (ANGLE_SCALE, "stretch $\\sigma_1/\\sigma_2$", ("1", "2", "4 or more")),
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
