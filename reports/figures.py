"""The figures of a report, each a function of the results: as PDF and PNG, with a caption.

All draw from the store and from the pictures of `reports.pictures`; one style, colours that the
colour-blind tell apart, and never colour alone.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from PIL import Image as Images

from benchmarks.distortion import (
    angle_difference_mean,
    area_discrepancy_total,
    face_distortion,
    triangles,
)
from benchmarks.metrics import MapState
from benchmarks.results import ResultRow
from parapoint.errors import InputError
from parapoint.parameterization import Parameterization
from parapoint.preparation import CUT
from parapoint.surface import Mesh
from reports.contents import Contents, Label
from reports.pictures import (
    ANGLE_SCALE,
    AREA_SCALE,
    known_keys,
    map_file,
    model_file,
    slug,
    source_hash,
)

STYLE: dict[Any, Any] = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "lines.linewidth": 1.3,
    "pdf.fonttype": 42,
    "savefig.dpi": 220,
    "svg.hashsalt": "parapoint",
}
"""The fonts come with matplotlib; the text width of a paper is `WIDTH`."""

WIDTH = 7.0
"""Width of a figure, inches."""

COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#7F7F7F", "#8C6D1F", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES = ("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), (0, (1, 1)), (0, (8, 2)))
OURS = "#D55E00"
"""Okabe and Ito's colours; the vermilion is ParaPoint's alone."""

ANGLE, AREA, FLIPPED = "angle_difference_mean", "area_discrepancy_total", "flipped_fraction"


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


def look(contents: Contents, label: Label) -> dict[str, Any]:
    """Colour, dashes and marker of a method, the same in every figure."""
    if label.method == "parapoint":
        ours = [other for other in contents.methods if other.method == "parapoint"]
        at = ours.index(label) % len(DASHES)
        return {"color": OURS, "linestyle": DASHES[at], "marker": MARKERS[-1 - at]}
    others = [other for other in contents.methods if other.method != "parapoint"]
    at = others.index(label) % len(COLOURS)
    return {"color": COLOURS[at], "linestyle": DASHES[at], "marker": MARKERS[at]}


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


def figure(width: float, height: float) -> Figure:
    """An empty figure, in inches, drawn without a screen."""
    made = Figure(figsize=(width, height))
    FigureCanvasAgg(made)
    return made


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


def put(place: Axes, path: Path) -> None:
    """Show a picture at `place`; a note where there is none."""
    place.set_axis_off()
    try:
        with Images.open(path) as image:
            box = place.get_window_extent()
            scale = STYLE["savefig.dpi"] / mpl.rcParams["figure.dpi"]
            image.thumbnail((round(box.width * scale), round(box.height * scale)))
            place.imshow(np.asarray(image), interpolation="bilinear")
    except OSError:
        note(place, "no picture")


def note(place: Axes, text: str) -> None:
    """A grey remark in the middle of `place`."""
    place.set_axis_off()
    place.text(
        0.5, 0.5, text, ha="center", va="center", color="0.45", transform=place.transAxes, wrap=True
    )


def picture_grid(
    heads: Sequence[str],
    rows: Sequence[tuple[str, str, Sequence[Path | str]]],
    *,
    side: float,
    left: float = 1.15,
    bottom: float = 0.05,
) -> Figure:
    """Rows of pictures (paths; other text is printed in their place) under column heads.

    Each row begins with a name and a smaller text below it. `side` is a picture's, in inches.
    """
    gap, top = 0.06, 0.28
    width = left + len(heads) * (side + gap)
    height = top + len(rows) * (side + gap) + bottom
    made = figure(width, height)
    for column, head in enumerate(heads):
        x = (left + column * (side + gap) + side / 2) / width
        made.text(x, 1 - 0.17 / height, head, ha="center", va="center", fontsize=8.5)
    for number, (name, text, pictures) in enumerate(rows):
        y = height - top - (number + 1) * (side + gap) + gap
        lines = 0.145 * (name.count("\n") + 1)
        made.text(0.04 / width, (y + side - 0.06) / height, name, va="top", fontsize=8.5)
        made.text(
            0.04 / width,
            (y + side - 0.1 - lines) / height,
            text,
            va="top",
            fontsize=7,
            color="0.3",
        )
        for column, picture in enumerate(pictures):
            x = left + column * (side + gap)
            place = made.add_axes((x / width, y / height, side / width, side / height))
            if isinstance(picture, Path):
                put(place, picture)
            else:
                note(place, picture)
    return made


def wrapped(name: str, width: int = 20) -> str:
    """`name` over several lines."""
    lines: list[str] = []
    for word in name.split():
        if lines and len(lines[-1]) + 1 + len(word) <= width:
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return "\n".join(lines)


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
        surface = surface_of(contents, case)
        size = f"{len(surface.faces):,} faces, {surface.topology}" if surface else "not at hand"
        middle = (x0 + side + gap / 2) / width
        made.text(middle, (y0 - 0.04) / height, case, ha="center", va="top", fontsize=8.5)
        made.text(
            middle, (y0 - 0.17) / height, size, ha="center", va="top", fontsize=7, color="0.35"
        )
    return made


def surface_of(contents: Contents, case: str) -> Mesh | None:
    """The mesh of a model, None where it is not stored or no mesh."""
    for row in contents.rows:
        if row.case == case and row.surface_hash:
            try:
                surface = contents.store.surface(row)
            except InputError:
                return None
            return surface if isinstance(surface, Mesh) else None
    return None


def is_cut(contents: Contents, case: str) -> bool:
    """Whether some method got the model with an automatic cut."""
    return any(CUT in row.preprocessing for row in contents.rows if row.case == case)


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
        cut = "automatic cut" if row is not None and CUT in row.preprocessing else "learned seam"
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


def small_multiples(count: int, height: float = 2.1) -> tuple[Figure, list[Axes]]:
    """A figure of `count` like panels, three in a row, with room for a legend below."""
    across = min(3, count)
    down = -(-count // across)
    made = figure(WIDTH, down * height + 0.55)
    grid = made.add_gridspec(
        down,
        across,
        left=0.08,
        right=0.985,
        top=1 - 0.25 / (down * height + 0.55),
        bottom=0.82 / (down * height + 0.55),
        hspace=0.45,
        wspace=0.28,
    )
    return made, [made.add_subplot(grid[n // across, n % across]) for n in range(count)]


def plain_log(axis: Axis) -> None:
    """Ticks at 1, 2 and 5 of each decade, as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0), numticks=7))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    axis.set_minor_formatter(NullFormatter())


def legend_below(made: Figure, places: Sequence[Axes]) -> None:
    """One legend for all panels, each method once."""
    found: dict[str, Any] = {}
    for place in places:
        for handle, text in zip(*place.get_legend_handles_labels(), strict=True):
            found.setdefault(text, handle)
    if found:
        made.legend(
            list(found.values()), list(found), loc="lower center", ncols=min(4, len(found)),
            columnspacing=1.4, handlelength=2.6,
        )  # fmt: skip


def losses(contents: Contents) -> Figure | None:
    """Loss terms of ParaPoint against iterations, model by model."""
    label = leading(contents, "parapoint")
    traces = {}
    for case in contents.cases:
        row = contents.shown(case, label) if label else None
        found = trace_of(contents, row) if row else pd.DataFrame()
        if len(found) > 1:
            traces[case] = found
    if not traces:
        return None
    made, places = small_multiples(len(traces))
    names = list(dict.fromkeys(name for found in traces.values() for name in found.columns))
    names = [name for name in names if name not in {"iteration", "seconds"}]
    for place, (case, found) in zip(places, traces.items(), strict=True):
        for number, name in enumerate(names):
            if name in found and (found[name] > 0).any():
                known = found[found[name] > 0]
                total = name in {"total", "loss"}
                place.plot(
                    known["iteration"],
                    known[name],
                    label=name.replace("_", " "),
                    color="0.1" if total else COLOURS[number % len(COLOURS)],
                    linestyle="-" if total else DASHES[number % len(DASHES)],
                    linewidth=1.6 if total else 1.1,
                )
        place.set_yscale("log")
        place.set_title(case)
        place.set_xlabel("iteration")
    places[0].set_ylabel("loss term")
    legend_below(made, places)
    return made


def trace_of(contents: Contents, row: ResultRow) -> pd.DataFrame:
    """The trace of a cell as a table: iteration, seconds, values by name; empty without one."""
    try:
        result = contents.store.result(row)
    except InputError:
        return pd.DataFrame()
    return pd.DataFrame(
        [
            {"iteration": iteration, "seconds": seconds, **values}
            for iteration, seconds, values, _ in result.trace
        ]
    )


def quality_trace(contents: Contents, row: ResultRow) -> pd.DataFrame:
    """Angle and area distortion over all faces along the way, where the maps were kept."""
    try:
        result, surface = contents.store.result(row), contents.store.surface(row)
    except InputError:
        return pd.DataFrame()
    if not isinstance(result, Parameterization) or not isinstance(surface, Mesh):
        return pd.DataFrame()
    records = []
    for at in result.trace:
        if at.uv is not None and len(at.uv) == len(result.uv):
            faces = triangles(surface, Parameterization(at.uv, result.corners))
            found = face_distortion(faces)
            records.append(
                {
                    "seconds": at.seconds,
                    "angle": angle_difference_mean(found),
                    "area": area_discrepancy_total(found),
                }
            )
    return pd.DataFrame(records)


def convergence(contents: Contents) -> Figure | None:
    """Angle distortion against time for every method with a trace; others as a single point."""
    return _convergence(contents, "angle", ANGLE, "angle difference [rad]")


def area_convergence(contents: Contents) -> Figure | None:
    """Area distortion against time, likewise."""
    return _convergence(contents, "area", AREA, "area discrepancy")


def _convergence(contents: Contents, name: str, metric: str, title: str) -> Figure | None:
    curves: dict[str, list[tuple[Label, pd.DataFrame]]] = {}
    traced = False
    for case in contents.cases:
        for label in contents.methods:
            row = contents.shown(case, label)
            if row is None or row.seconds is None:
                continue
            found = quality_trace(contents, row)
            traced |= len(found) > 1
            if len(found) < 2:
                value = contents.measured.loc[contents.measured["id"] == row.id, metric]
                found = pd.DataFrame({"seconds": [row.seconds], name: [float(value.iloc[0])]})
            curves.setdefault(case, []).append((label, found))
    if not traced:
        return None
    made, places = small_multiples(len(curves))
    for place, (case, lines) in zip(places, curves.items(), strict=True):
        for label, found in lines:
            known = found[np.isfinite(found[name]) & (found["seconds"] > 0)]
            place.plot(
                known["seconds"], known[name], label=label.short, markersize=3.5,
                **look(contents, label),
            )  # fmt: skip
        place.set_xscale("log")
        plain_log(place.xaxis)
        if name == "angle":
            place.set_yscale("log")
            plain_log(place.yaxis)
        place.set_title(case)
        place.set_xlabel("seconds")
    places[0].set_ylabel(title)
    legend_below(made, places)
    return made


def pareto(contents: Contents) -> Figure | None:
    """Angle against area distortion, model by model: nearer to the lower left is better."""
    good = contents.means[contents.means["ok"] > 0]
    good = good[np.isfinite(good[ANGLE]) & np.isfinite(good[AREA])]
    cases = [case for case in contents.cases if (good["case"] == case).any()]
    if not cases:
        return None
    made, places = small_multiples(len(cases))
    for place, case in zip(places, cases, strict=True):
        own = good[good["case"] == case].set_index("label")
        for label in contents.methods:
            if label.short in own.index:
                record = own.loc[label.short]
                style = look(contents, label) | {"linestyle": "none", "markersize": 6.5}
                if label.short in contents.atlases:
                    style |= {"markerfacecolor": "none", "markeredgecolor": style["color"]}
                else:
                    style |= {"markeredgecolor": "white", "markeredgewidth": 0.5}
                at = [max(float(record[AREA]), 1e-4)], [max(float(record[ANGLE]), 1e-6)]
                place.plot(*at, label=label.short, **style)
        own = own[~own.index.isin(contents.atlases)]
        points = own[[AREA, ANGLE]].clip(lower=[1e-4, 1e-6]).sort_values(AREA).to_numpy(dtype=float)
        best = np.minimum.accumulate(points[:, 1])
        place.step(points[:, 0], best, where="post", color="0.6", linewidth=0.8, zorder=1)
        place.set_yscale("log")
        plain_log(place.yaxis)
        place.set_xlim(left=0)
        place.set_title(case)
        place.set_xlabel("area discrepancy")
    places[0].set_ylabel("angle difference [rad]")
    legend_below(made, places)
    return made


def singular_values(contents: Contents) -> Figure | None:
    """How much of the surface is stretched by how much: both singular values, all methods."""
    cases = [case for case in contents.cases if surface_of(contents, case) is not None]
    cases = [case for case in cases if any(contents.shown(case, m) for m in contents.methods)]
    if not cases:
        return None
    made, places = small_multiples(len(cases))
    bins = np.linspace(-5, 5, 61)
    middle = (bins[1:] + bins[:-1]) / 2
    for place, case in zip(places, cases, strict=True):
        surface = surface_of(contents, case)
        assert surface is not None
        for label in contents.methods:
            row = contents.shown(case, label)
            if row is None:
                continue
            try:
                result = contents.store.result(row)
            except InputError:
                continue
            if not isinstance(result, Parameterization):
                continue
            found = MapState(surface, result).distortion_without_spanning
            style = look(contents, label) | {"marker": "", "linewidth": 1.0}
            for sigma in (found.sigma1, found.sigma2):
                known = found.finite & (sigma > 0)
                at = np.clip(np.log2(sigma[known]), -5, 5)
                share, _ = np.histogram(at, bins, weights=found.area[known])
                shown = label.short if sigma is found.sigma1 else None
                place.plot(middle, share, label=shown, **style)
        place.axvline(0, color="0.5", linewidth=0.6)
        place.set_yscale("log")
        place.set_ylim(1e-3, 1.3)
        place.set_xticks([-4, -2, 0, 2, 4], ["1/16", "1/4", "1", "4", "16"])
        place.set_title(case)
        place.set_xlabel(r"$\sigma_1$, $\sigma_2$")
    places[0].set_ylabel("share of the area")
    legend_below(made, places)
    return made


def cost(contents: Contents) -> Figure | None:
    """Time against the number of faces for every method."""
    surfaces = {case: surface_of(contents, case) for case in contents.cases}
    sizes = {case: len(mesh.faces) for case, mesh in surfaces.items() if mesh is not None}
    if len(set(sizes.values())) < 2:
        return None
    made, places = small_multiples(1, height=3.0)
    place = places[0]
    for label in contents.methods:
        rows = [contents.shown(case, label) for case in sizes]
        points = sorted((sizes[row.case], row.seconds) for row in rows if row and row.seconds)
        if points:
            place.plot(
                *zip(*points, strict=True), label=label.short, markersize=4, **look(contents, label)
            )
    place.set_xscale("log")
    place.set_yscale("log")
    plain_log(place.xaxis)
    plain_log(place.yaxis)
    place.set_xlabel("faces")
    place.set_ylabel("seconds")
    legend_below(made, places)
    return made


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
        made.savefig(files[0], metadata={"CreationDate": None, "Title": drawing.title})
        made.savefig(files[1], metadata={"Title": drawing.title})
