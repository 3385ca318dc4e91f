"""What the figures of small suites show: every axis, tick, line, word and picture, and its place.

`tests/golden/figures` holds it, figure by figure, to three digits.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.text import Text

from reports.contents import contents
from reports.pictures.figures import drawings
from reports.pictures.style import STYLE

from ..approving import check
from ..small_suites import ablation, varied


def said(values) -> str:
    """Numbers in few digits; of many the first, the last, their number and their mean."""
    values = np.asarray(values, dtype=np.float64).ravel()
    if len(values) > 12:
        return f"{said(values[:3])} ... {said(values[-3:])}, {len(values)}: {said([values.mean()])}"
    return " ".join(f"{value + 0.0:.3g}" for value in values)


def shown(made: Figure) -> list[str]:
    """What is in a figure, line by line, in the order in which it is drawn."""
    lines = [f"size {said(made.get_size_inches())}"]
    for place in made.axes:
        lines.append(f"axes at {said(place.get_position().bounds)}, {place.get_xscale()}")
        lines.append(
            f"  {place.get_yscale()}, limits {said([*place.get_xlim(), *place.get_ylim()])}"
        )
        for one in place.get_children():
            lines += [f"  {line}" for line in artist(one)]
        if place.axison:
            seen = [name for name, line in place.spines.items() if line.get_visible()]
            lines.append(f"  lines: {' '.join(seen)}")
            lines += [f"  {axis(one)}" for one in (place.xaxis, place.yaxis)]
    lines += [line for one in made.texts for line in artist(one)]
    for legend in made.legends:
        lines.append(f"legend{' in a frame' * legend.get_frame_on()}")
        lines += [f"  {one.get_text()!r}, {one.get_size():.3g} pt" for one in legend.get_texts()]
    return lines


def axis(one: Axis) -> str:
    """What stands along an axis: its label, its ticks, and whether lines go on from these."""
    label, ticks = one.get_label(), one.get_ticklabels()
    words = " ".join(repr(text.get_text()) for text in [label, *ticks])
    sizes = said(sorted({text.get_size() for text in [label, *ticks]}))
    grid = ", a grid" * any(line.get_visible() for line in one.get_gridlines())
    return f"{one.axis_name}: {words}, {sizes} pt{grid}"


def artist(one) -> list[str]:
    """What is to be said of a part of a figure."""
    if not one.get_visible():
        return []
    if isinstance(one, Text):
        place = f"at {said(one.get_position())}, {one.get_size():.3g} pt {to_hex(one.get_color())}"
        alike = f"{one.get_ha()} {one.get_va()} {one.get_rotation():.3g} {one.get_weight()}"
        return [f"{one.get_text()!r} {place} {alike}"] if one.get_text() else []
    if isinstance(one, Line2D):
        kind = f"{one.get_linestyle()} {one.get_linewidth():.3g} {one.get_marker()}"
        if one.get_marker() not in {"None", "", None}:
            filled = "hollow" if one.get_markerfacecolor() == "none" else "filled"
            kind += f" {one.get_markersize():.3g} {filled}"
        known = f"{to_hex(one.get_color())} {one.get_label()!r} {one.get_alpha()}"
        return [f"line {kind} {known}: {said(one.get_xdata())}; {said(one.get_ydata())}"]
    if isinstance(one, Collection):
        return [f"{type(one).__name__}: {said(one.get_offsets())} {said(one.get_facecolor())}"]
    if isinstance(one, AxesImage):
        return [f"picture {said(one.get_size())} {said(one.get_extent())}"]
    return []


def everything(suite, pictures: Path) -> str:
    """All figures of a suite, with their captions."""
    lines = []
    with mpl.rc_context(STYLE):
        for drawing in drawings(suite, pictures):
            lines += [f"# {drawing.name}: {drawing.title}", drawing.caption]
            made = drawing.figure()
            lines += ["nothing"] if made is None else shown(made)
    return "\n".join(lines) + "\n"


def test_figures_of_a_report_show_what_was_approved(reported, tmp_path):
    pictures = reported / "report" / "figures" / "paper" / "pictures"
    check("figures/report.txt", everything(contents(reported)[0], pictures), tmp_path)


@pytest.mark.parametrize("suite", [varied, ablation], ids=lambda suite: suite.__name__)
def test_figures_show_what_was_approved(suite, tmp_path):
    made = suite(tmp_path / "results")
    check(f"figures/{suite.__name__}.txt", everything(made, tmp_path / "none"), tmp_path)
