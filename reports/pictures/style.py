"""The one style of all figures: fonts, colours, how pictures, panels and legends are set."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from PIL import Image as Images

from reports.contents import Contents
from reports.labels import Label

STYLE: dict[Any, Any] = {
    "font.family": "STIXGeneral",
    "text.parse_math": False,
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
"""The fonts come with matplotlib, and no name with dollars is read as a formula. The text width of
a paper is `WIDTH`."""

DARK_PAPER, DARK_INK = "#1d2025", "#e7e5df"
"""Background and text of a figure on a dark page: --card and --ink of its style sheet."""

GREY_SPREAD = 0.05
"""Largest difference of red, green and blue, from 0 to 1, of what counts as grey."""

WIDTH = 7.0
"""Width of a figure, inches."""

COLOURS = (
    *("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9"),
    *("#7F7F7F", "#8C6D1F", "#000000", "#882255"),
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "p", "h", "*")
DASHES = (
    *("-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1))),
    *((0, (1, 1)), (0, (8, 2)), (0, (6, 1, 2, 1))),
)
OURS = "#D55E00"
"""Okabe and Ito's colours and four more; the vermilion and the star are ParaPoint's alone."""


def look(contents: Contents, label: Label) -> dict[str, Any]:
    """Colour, dashes and marker of a method, the same in every figure."""
    if label.method == "parapoint":
        ours = [other for other in contents.methods if other.method == "parapoint"]
        at = ours.index(label) % len(DASHES)
        alone = len(ours) == len(contents.methods)  # an ablation: its variants need colours, too
        colour = COLOURS[at - 1] if at and alone else OURS
        return {"color": colour, "linestyle": DASHES[at], "marker": MARKERS[-1 - at]}
    others = [other for other in contents.methods if other.method != "parapoint"]
    turn, at = divmod(others.index(label), len(COLOURS))
    other = (at + turn) % len(COLOURS)  # a colour that comes again has other marks
    return {"color": COLOURS[at], "linestyle": DASHES[other], "marker": MARKERS[other]}


def figure(width: float, height: float) -> Figure:
    """An empty figure, in inches, drawn without a screen."""
    made = Figure(figsize=(width, height))
    FigureCanvasAgg(made)
    return made


Box = tuple[float, float, float, float]
"""Left, bottom, width and height of a part of a figure, as fractions of the whole."""


def put(made: Figure, box: Box, picture: Path | str) -> None:
    """Show a picture in the middle of `box`, at the size it is printed; other text as a note."""
    sheet = _sheet(made)
    if isinstance(picture, str):
        note(sheet, box, picture)
        return
    try:
        with Images.open(picture) as image:
            shown = image.convert("RGBA")
    except OSError:
        note(sheet, box, "no picture")
        return
    x, y, width, height = box
    whole, dpi = made.get_size_inches(), mpl.rcParams["savefig.dpi"]
    shown.thumbnail((round(width * whole[0] * dpi), round(height * whole[1] * dpi)))
    fill = min(width * whole[0] / shown.width, height * whole[1] / shown.height)
    wide, tall = fill * shown.width / whole[0], fill * shown.height / whole[1]
    left, low = x + (width - wide) / 2, y + (height - tall) / 2
    sheet.imshow(shown, extent=(left, left + wide, low, low + tall), aspect="auto")


def _sheet(made: Figure) -> Axes:
    """The axes of all pictures of a figure: axes of its own for each would cost more than it."""
    for place in made.axes:
        if place.get_label() == SHEET:
            return place
    place = made.add_axes((0, 0, 1, 1), label=SHEET, autoscale_on=False)
    place.set_axis_off()
    return place


SHEET = "pictures"
"""Label of the axes of all pictures of a figure."""


def darken(made: Figure) -> None:
    """Turn a figure into one for a dark page: greys are turned over, colours stay."""
    made.set_facecolor(DARK_PAPER)
    for artist in made.findobj(lambda one: one is not made.patch and not isinstance(one, Axes)):
        for part in ("color", "facecolor", "edgecolor", "markerfacecolor", "markeredgecolor"):
            if part == "color" and not isinstance(artist, Text | Line2D):
                continue  # of other artists it is both of the next two
            found = getattr(artist, f"get_{part}", None)
            if found is not None:
                getattr(artist, f"set_{part}")(_turned(found()))


def _turned(colour: Any) -> Any:
    """A colour, or (n, 4) of them, with greys between black and white turned over."""
    if isinstance(colour, str) and colour in {"none", "auto"}:
        return colour
    colours = to_rgba_array(colour)
    grey = np.ptp(colours[:, :3], axis=1) < GREY_SPREAD
    paper, ink = to_rgba_array(DARK_PAPER)[0, :3], to_rgba_array(DARK_INK)[0, :3]
    colours[grey, :3] = ink + (paper - ink) * colours[grey, :1]
    return colours if len(colours) != 1 else tuple(colours[0])


def note(sheet: Axes, box: Box, text: str) -> None:
    """A grey remark in the middle of `box`."""
    x, y, width, height = box
    sheet.text(x + width / 2, y + height / 2, text, ha="center", va="center", color="0.45")


def picture_grid(
    heads: Sequence[str],
    rows: Sequence[tuple[str, str, Sequence[Path | str]]],
    *,
    side: float,
    left: float = 1.15,
    bottom: float = 0.05,
) -> Figure:
    """Rows of pictures (paths; other text is printed in their place) under column heads.

    Each row begins with a name and a smaller text below it. `side` is a picture's, in inches; a row
    without any picture is low.
    """
    gap, top, low = 0.06, 0.28, 0.4
    heights = [side if any(isinstance(one, Path) for one in row[2]) else low for row in rows]
    width = left + len(heads) * (side + gap)
    height = top + sum(heights) + len(rows) * gap + bottom
    made = figure(width, height)
    for column, head in enumerate(heads):
        x = (left + column * (side + gap) + side / 2) / width
        made.text(x, 1 - 0.17 / height, head, ha="center", va="center", fontsize=8.5)
    y = height - top
    for (name, text, pictures), tall in zip(rows, heights, strict=True):
        for down, words, size, tone in (
            (0.06, name, 8.5, "0"),
            (0.12 + 0.175 * (name.count("\n") + 1), text, 7, "0.3"),
        ):
            made.text(0.04 / width, (y - down) / height, words, va="top", fontsize=size, color=tone)
        for column, picture in enumerate(pictures):
            x = left + column * (side + gap)
            box = (x / width, (y - tall) / height, side / width, tall / height)
            put(made, box, picture)
        y -= tall + gap
    return made


def wrapped(name: str, width: int = 20) -> str:
    """`name` over several lines, parted at spaces, hyphens and underscores."""
    lines = [""]
    for piece in re.split(r"(?<=[-_ ])", name):
        if lines[-1] and len((lines[-1] + piece).rstrip()) > width:
            lines.append("")
        lines[-1] += piece
    return "\n".join(line.rstrip() for line in lines)


def small_multiples(
    count: int, height: float = 2.1, *, left: float = 0.08, bottom: float = 1.0
) -> tuple[Figure, list[Axes]]:
    """A figure of `count` like panels, three in a row, with room for a legend below."""
    across = min(3, count)
    down = -(-count // across)
    made = figure(WIDTH, down * height + bottom - 0.27)
    grid = made.add_gridspec(
        down,
        across,
        left=left,
        right=0.975,
        top=1 - 0.25 / (down * height + bottom - 0.27),
        bottom=bottom / (down * height + bottom - 0.27),
        hspace=0.65 / (height - 0.65),  # inches, whatever the height
        wspace=0.28,
    )
    return made, [made.add_subplot(grid[n // across, n % across]) for n in range(count)]


def plain_log(axis: Axis) -> None:
    """Ticks at 1, 2 and 5 of each decade, or at 1 alone where there are many, as plain numbers."""
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high < 100 * low else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs, numticks=7))
    axis.set_major_formatter(FuncFormatter(lambda value, _: _plain(value)))
    axis.set_minor_formatter(NullFormatter())


def _plain(value: float) -> str:
    """A number, with an exponent below 0.0001."""
    if value >= 1e-4:
        return f"{value:,g}"
    mantissa, exponent = f"{value:.0e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def legend_below(made: Figure, places: Sequence[Axes]) -> None:
    """One legend for all panels, each method once, in as many columns as there is room for."""
    found: dict[str, Any] = {}
    for place in places:
        for handle, text in zip(*place.get_legend_handles_labels(), strict=True):
            found.setdefault(text, handle)
    if not found:
        return
    for columns in range(min(4, len(found)), 0, -1):
        legend = made.legend(
            list(found.values()), list(found), loc="lower center", ncols=columns,
            columnspacing=1.4, handlelength=2.6,
        )  # fmt: skip
        for shown in filter(None, legend.legend_handles):
            shown.set_alpha(1)  # a marker may be pale in the first panel that has it
        if columns == 1 or legend.get_window_extent().width < made.bbox.width:
            break
        legend.remove()
    boxes = [place.get_tightbbox() for place in places]
    lowest = min(box.y0 for box in boxes if box is not None)
    _grow(made, (legend.get_window_extent().y1 - lowest) / made.dpi)


def _grow(made: Figure, room: float) -> None:
    """Make `room` below the panels of a figure, in inches, where there is none."""
    if room <= 0:
        return
    width, height = made.get_size_inches()
    made.set_size_inches(width, height + room)
    for place in made.axes:
        x, y, wide, tall = place.get_position().bounds
        whole = height + room
        place.set_position((x, (y * height + room) / whole, wide, tall * height / whole))
