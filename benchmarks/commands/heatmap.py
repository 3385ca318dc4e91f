"""Pictures of the distortion of a map, face by face: on the surface and in the UV plane."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from benchmarks.metrics.state import MapState
from benchmarks.rendering.maps import ANGLE_SCALE, AREA_SCALE, Layout, Map, heat
from benchmarks.rendering.scene import Scene
from benchmarks.rendering.viewpoints import two_cameras
from parapoint.errors import InputError
from parapoint.files.targets import complete_file
from parapoint.surfaces.surface import FloatArray

PIXELS = 560
"""Longer side of each picture, in pixels."""
LARGEST_RATIOS = (1.05, 1.2, 1.5, 2.0, 4.0, 10.0, 100.0)
"""Where a colour scale may end: at the first ratio that 95 % of the faces do not exceed."""
HEADINGS = ("surface, one side", "surface, other side", "UV plane")


def write_heatmap(state: MapState, path: Path, *, title: str) -> None:
    """Draw the distortion of angles and of areas, from two sides and in the UV plane.

    The renderer and the colours are those of the reports; faces that span a seam are left grey.

    Raises:
        InputError: the map has no area.
        OSError: the file cannot be written.
    """
    found = Map(state.mesh, state.parameterization)
    if not found.has_area:
        raise InputError(f"{title}: the map has no area in the UV plane, so there is no heatmap")
    scene = Scene(state.mesh, shadows=False)  # colours can be compared where none is in the shade
    views = [scene.view(camera, PIXELS) for camera in two_cameras(scene)]
    layout = Layout(found, PIXELS)
    angle_end, area_end = _scale_end(found.angle), _scale_end(np.abs(found.area))
    rows: list[tuple[str, FloatArray, tuple[str, float, float]]] = [
        ("angles: σ1/σ2", found.angle, (ANGLE_SCALE[0], 0.0, angle_end)),
        ("areas: UV area / 3D area", found.area, (AREA_SCALE[0], -area_end, area_end)),
    ]
    figure = Figure(figsize=(14, 9), dpi=120, layout="constrained")
    axes = figure.subplots(2, 3)
    for line, (label, values, scale) in zip(axes, rows, strict=True):
        colours = heat(values, scale)
        shown = [view.image(colours[view.face]) for view in views]
        for axis, picture in zip(line, [*shown, layout.image(colours)], strict=True):
            axis.imshow(picture, interpolation="antialiased")
            axis.set_axis_off()
        _add_bar(figure, line, label, scale)
    for axis, heading in zip(axes[0], HEADINGS, strict=True):
        axis.set_title(heading, fontsize=11)
    figure.suptitle(f"{title}: distortion of {len(state.mesh.faces):,} faces")
    with complete_file(path) as file:
        figure.savefig(file, format="png")


def _scale_end(logarithms: FloatArray) -> float:
    """log2 of the first of LARGEST_RATIOS that 95 % of the faces do not exceed.

    `logarithms` (F,) are those of ratios of at least 1, to the base 2; NaN where there is none.
    """
    known = np.sort(logarithms[~np.isnan(logarithms)])
    high = known[int(0.95 * (len(known) - 1))] if len(known) else 0.0
    ends = np.log2(LARGEST_RATIOS)
    return float(ends[min(np.searchsorted(ends, high), len(ends) - 1)])


def _add_bar(figure: Figure, line: Any, label: str, scale: tuple[str, float, float]) -> None:
    """The colour bar of a row of pictures, with ratios at its ticks."""
    name, low, high = scale
    bar = figure.colorbar(
        ScalarMappable(Normalize(low, high), name),
        ax=line,
        shrink=0.8,
        extend="max" if low == 0 else "both",
        pad=0.01,
    )
    ticks = np.linspace(low, high, 5).tolist()
    bar.set_ticks(ticks, labels=[f"{2**tick:.3g}" for tick in ticks])
    bar.set_label(label)
