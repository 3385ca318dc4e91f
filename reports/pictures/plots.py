"""The figures that are plots: distortion against distortion, time and size; losses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.surface import FloatArray
from reports.contents import ANGLE, AREA, FLIPPED_OFF_SEAM, ISOMETRIC, SEAM, Contents
from reports.labels import Label
from reports.pictures.curves import BINS, curves_of
from reports.pictures.galleries import leading
from reports.pictures.style import (
    COLOURS,
    DASHES,
    legend_below,
    look,
    plain_log,
    small_multiples,
    wrapped,
)
from reports.ranking import may_rank

WAY = {
    ANGLE: "angle difference [rad]",
    AREA: "area discrepancy",
    FLIPPED_OFF_SEAM: "flipped faces [%]",
}
"""What is known of the maps on the way to a map, in the order of `Curves.way`, and its axis."""
LEAST_ANGLE, LEAST_AREA = 1e-4, 1e-3
"""Angle difference in radians, and area discrepancy, below which figures draw all values alike.

Tables print smaller ones as "<0.0001" and "<0.001".
"""
MOST_ENERGY = 20.0
"""Symmetric Dirichlet energy, 4 at least, above which figures draw all values alike."""
LEAST_SIZES = 5
"""Least number of different sizes through which a power law is drawn."""
LEAST, MOST = 1e-30, 1e30
"""Seconds and losses between which values are drawn: nobody measured a number beyond."""


def _drawn(values: pd.Series) -> pd.Series:
    """Which values of a column can be drawn on a logarithmic axis."""
    return (values > LEAST) & (values < MOST)


def losses(contents: Contents, cases: Sequence[str]) -> Figure | None:
    """Loss terms of ParaPoint against iterations, model by model."""
    label = leading(contents, "parapoint")
    traces = {}
    for case in cases:
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
            if name in found and (drawn := _drawn(found[name])).any():
                known = found[drawn]
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
        plain_log(place.yaxis)
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


def convergence(
    contents: Contents, pictures: Path, cases: Sequence[str], metric: str
) -> Figure | None:
    """A metric of WAY against time, a line a seed, for every method with a trace.

    Other methods have a single point for each seed.
    """
    curves: dict[str, list[tuple[Label, pd.DataFrame]]] = {}
    traced = False
    for case in cases:
        for label in contents.methods:
            for row in contents.cell(case, label):
                if row.status != "ok" or row.seconds is None:
                    continue
                made_of = curves_of(contents, row, pictures)
                found = pd.DataFrame(made_of.way if made_of else [], columns=["seconds", *WAY])
                traced |= len(found) > 1
                if len(found) < 2:
                    value = contents.measured.loc[contents.measured["id"] == row.id, metric]
                    found = pd.DataFrame({"seconds": [row.seconds], metric: [float(value.iloc[0])]})
                known = found[np.isfinite(found[metric]) & _drawn(found["seconds"])].copy()
                known[metric] = known[metric].clip(lower=LEAST_ANGLE if metric == ANGLE else None)
                if len(known):  # a map of points has neither angles nor areas of faces
                    curves.setdefault(case, []).append((label, known))
    if not traced:
        return None
    made, places = small_multiples(len(curves))
    for place, (case, lines) in zip(places, curves.items(), strict=True):
        for label, known in lines:
            percent = 100 if metric == FLIPPED_OFF_SEAM else 1
            place.plot(
                known["seconds"], percent * known[metric], label=label.short, markersize=3.5,
                **look(contents, label),
            )  # fmt: skip
        place.set_xscale("log")
        if metric == ANGLE:
            place.set_yscale("log")
        else:
            place.set_ylim(bottom=0)
        place.set_title(case)
        place.set_xlabel("seconds")
    places[0].set_ylabel(WAY[metric])
    share_limits(places)
    legend_below(made, places)
    return made


def pareto(contents: Contents, cases: Sequence[str]) -> Figure | None:
    """Angle against area distortion, model by model: nearer to the lower left is better."""
    shown = {case: points for case in cases if len(points := trade_offs(contents, case))}
    if not shown:
        return None
    made, places = small_multiples(len(shown))
    for place, (case, points) in zip(places, shown.items(), strict=True):
        place.set_yscale("log")
        _mark(place, contents, points, AREA, ANGLE)
        front = pareto_front(contents, points)
        place.step(front[:, 0], front[:, 1], where="post", color="0.6", linewidth=0.8, zorder=1)
        place.set_title(case)
        place.set_xlabel("area discrepancy")
    places[0].set_ylabel("angle difference [rad]")
    share_limits(places)
    for place in places:
        right = place.get_xlim()[1]
        place.set_xlim(-0.04 * right, right)  # no marker is cut at the left end
    legend_below(made, places)
    return made


def _mark(place: Axes, contents: Contents, points: pd.DataFrame, x: str, y: str) -> None:
    """A marker for each method: hollow without a map of the whole, pale where it is not `fit`."""
    for label in contents.methods:
        if label.short in points.index:
            style = look(contents, label) | {"linestyle": "none"}
            style["markersize"] = 10 if style["marker"] == "*" else 6.5
            if label.short in contents.unranked:
                style |= {"markerfacecolor": "none", "markeredgecolor": style["color"]}
            else:
                style |= {"markeredgecolor": "white", "markeredgewidth": 0.5}
            if not points.loc[label.short, "fit"]:
                style["alpha"] = 0.35
            at = points.loc[label.short, [x, y]]
            place.plot(at.iloc[0], at.iloc[1], label=label.short, clip_on=False, **style)


def seams(contents: Contents, cases: Sequence[str]) -> Figure | None:
    """Symmetric Dirichlet energy against the seam's length, of each model that some map cuts."""
    priced = {case: prices(contents, case) for case in cases}
    shown = {case: points for case, points in priced.items() if (points[SEAM] > 0).any()}
    if not shown:
        return None
    made, places = small_multiples(len(shown))
    for place, (case, points) in zip(places, shown.items(), strict=True):
        place.set_yscale("log")
        _mark(place, contents, points, SEAM, ISOMETRIC)
        place.set_title(case)
        place.set_xlabel("seam / √area")
    places[0].set_ylabel("symmetric Dirichlet energy")
    share_limits(places)
    for place in places:
        right = place.get_xlim()[1]
        place.set_xlim(-0.04 * right, right)
    legend_below(made, places)
    return made


def prices(contents: Contents, case: str) -> pd.DataFrame:
    """Seam and energy of the maps of a model, and whether each is `fit` to be ranked.

    By the methods' short names; energies above MOST_ENERGY are lowered to it.
    """
    own = contents.means[(contents.means["case"] == case) & (contents.means["ok"] > 0)]
    own = own[np.isfinite(own[SEAM]) & np.isfinite(own[ISOMETRIC])].set_index("label")
    points: pd.DataFrame = own[[SEAM, ISOMETRIC]].clip(upper=[np.inf, MOST_ENERGY], axis=1)
    points["fit"] = [may_rank(found, angles=False) for found in own["grade"]]
    return points


def trade_offs(contents: Contents, case: str) -> pd.DataFrame:
    """Area and angle distortion of the maps of a model, and whether each is `fit` to be ranked.

    By the methods' short names; values below LEAST_AREA and LEAST_ANGLE are raised to them.
    """
    own = contents.means[(contents.means["case"] == case) & (contents.means["ok"] > 0)]
    own = own[np.isfinite(own[ANGLE]) & np.isfinite(own[AREA])].set_index("label")
    points: pd.DataFrame = own[[AREA, ANGLE]].clip(lower=[LEAST_AREA, LEAST_ANGLE], axis=1)
    points["fit"] = [may_rank(found, angles=False) for found in own["grade"]]
    return points


def pareto_front(contents: Contents, points: pd.DataFrame) -> FloatArray:
    """(n, 2) area and angle of the `trade_offs` that no other one with one chart beats in both.

    Broken and collapsed maps take no part. By rising area; of one area there is one point.
    """
    rivals = points[points["fit"] & ~points.index.isin(contents.unranked)]
    values = rivals.sort_values([AREA, ANGLE])[[AREA, ANGLE]].to_numpy(dtype=np.float64)
    before = np.concatenate([[np.inf], np.minimum.accumulate(values[:, 1])[:-1]])[: len(values)]
    return np.asarray(values[values[:, 1] < before])


def share_limits(places: Sequence[Axes]) -> None:
    """Let all panels of a figure end where the widest does, so that they can be compared."""
    for name in ("x", "y"):
        limits = np.array([getattr(place, f"get_{name}lim")() for place in places])
        for place in places:
            getattr(place, f"set_{name}lim")(limits[:, 0].min(), limits[:, 1].max())
            axis = getattr(place, f"{name}axis")
            if axis.get_scale() == "log":
                plain_log(axis)


def singular_values(contents: Contents, pictures: Path, cases: Sequence[str]) -> Figure | None:
    """How much of the surface is stretched by how much: both singular values, method by method."""
    cases = [case for case in cases if any(contents.shown(case, m) for m in contents.methods)]
    if not cases:
        return None
    labels = contents.methods
    tall = 0.33 * len(labels) + 0.8
    made, places = small_multiples(len(cases), tall, left=0.21, bottom=0.5)
    middle = (BINS[1:] + BINS[:-1]) / 2
    for number, (place, case) in enumerate(zip(places, cases, strict=True)):
        for line, label in enumerate(labels):
            row = contents.shown(case, label)
            found = curves_of(contents, row, pictures) if row else None
            y = len(labels) - 1 - line
            if found is None or len(found.shares) < 2:
                place.text(-4.8, y + 0.1, "no map", fontsize=6.5, color="0.5")
                continue
            larger, smaller = 0.85 * found.shares / found.shares.max()
            colour = look(contents, label)["color"]
            place.fill_between(middle, y, y + larger, step="mid", color=colour, alpha=0.4, lw=0)
            place.step(middle, y + smaller, where="mid", color=colour, linewidth=0.9)
        place.axvline(0, color="0.5", linewidth=0.6)
        place.set_xlim(-5, 5)
        place.set_ylim(-0.1, len(labels))
        place.set_xticks([-5, -2, 0, 2, 5], ["≤1/32", "1/4", "1", "4", "≥32"])
        names = [wrapped(label.short, 25) for label in labels][::-1]
        shown = names if number % 3 == 0 else [""] * len(names)
        middles = np.arange(len(labels)) + 0.3
        place.set_yticks(middles, shown, fontsize=6.5, linespacing=0.85)
        place.grid(visible=False, axis="y")
        place.tick_params(axis="y", length=0)
        place.set_title(case)
        place.set_xlabel("σ1 (filled), σ2 (line)")
    return made


def cost(contents: Contents) -> Figure | None:
    """Time against the number of faces for every method, with its power law if it has enough."""
    surfaces = {case: contents.mesh(case) for case in contents.cases}
    sizes = {case: len(mesh.faces) for case, mesh in surfaces.items() if mesh is not None}
    if len(set(sizes.values())) < 2:
        return None
    made, places = small_multiples(1, height=3.0)
    place = places[0]
    for label in contents.methods:
        rows = [contents.shown(case, label) for case in sizes]
        points = [
            (sizes[row.case], row.seconds)
            for row in rows
            if row and row.seconds and LEAST < row.seconds < MOST
        ]
        if not points:
            continue
        style = look(contents, label)
        faces, seconds = np.array(points, dtype=np.float64).T
        dots = style | {"linestyle": "none"}
        place.plot(faces, seconds, label=label.short, markersize=3.5, alpha=0.7, **dots)
        ends = np.array([faces.min(), faces.max()])
        if len(np.unique(faces)) < LEAST_SIZES:
            continue
        line = np.exp(np.polyval(np.polyfit(np.log(faces), np.log(seconds), 1), np.log(ends)))
        place.plot(ends, line, markersize=4, markevery=[], **style)
    place.set_xscale("log")
    place.set_yscale("log")
    plain_log(place.xaxis)
    plain_log(place.yaxis)
    place.set_xlabel("faces")
    place.set_ylabel("seconds")
    legend_below(made, places)
    return made
