"""Pictures of the distortion of a map, face by face: on the surface and in the UV plane."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import igl
import matplotlib as mpl
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.colors import Colormap, LogNorm, Normalize
from matplotlib.figure import Figure

from benchmarks.metrics.state import MapState
from parapoint.errors import InputError
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

PIXELS = 560
"""Side of each picture of the surface."""
LARGEST_RATIOS = (1.05, 1.2, 1.5, 2.0, 4.0, 10.0, 100.0)
"""Where a colour scale may end: at the first that 95 % of the faces do not exceed."""
CONFORMAL_COLOURS, AREA_COLOURS = "YlGnBu", "PuOr"
"""Light is ideal. Colour-blind readers can tell both: by lightness, and orange from purple."""
MISSING = (0.6, 0.6, 0.6)
"""Colour of faces without distortion: degenerate in 3D."""
OUTLINE = (0.5, 0.5, 0.5, 0.25)
"""Colour of the outlines of faces that span a seam."""
VIEWS = (np.array([0.55, 0.35, 1.0]), np.array([-0.55, 0.35, -1.0]))
"""Directions from the surface to the eye; y is up."""


def write_heatmap(state: MapState, path: Path, *, title: str) -> None:
    """Draw conformal and area distortion of every face, from two sides and in the UV plane.

    Raises:
        InputError: the path is no .png.
        OSError: the file cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: the heatmap is a PNG; give a name that ends in .png")
    faces, distortion = len(state.mesh.faces), state.distortion
    conformal, ratio = np.full(faces, np.nan), np.full(faces, np.nan)
    conformal[distortion.faces] = distortion.quasi_conformal
    ratio[distortion.faces] = distortion.area_ratio
    # Both scales are logarithmic; what lies beyond their ends has the colour of the end.
    top = _scale_end(distortion.quasi_conformal)
    area_top = _scale_end(np.exp(np.minimum(distortion.area_log_ratio, 700.0)))
    rows: list[tuple[str, FloatArray, Normalize, Colormap]] = [
        (
            "angles: σ1/σ2",
            np.clip(conformal, 1.0, top),
            LogNorm(1.0, top),
            mpl.colormaps[CONFORMAL_COLOURS],
        ),
        (
            "areas: UV / 3D area",
            np.clip(ratio, 1 / area_top, area_top),
            LogNorm(1 / area_top, area_top),
            mpl.colormaps[AREA_COLOURS],
        ),
    ]
    pictures = [_visible(state.mesh, view) for view in VIEWS]
    figure = Figure(figsize=(14, 9), dpi=120, layout="constrained")
    axes = figure.subplots(2, 3, width_ratios=(1, 1, 1.15))
    for line, (label, values, norm, colours) in zip(axes, rows, strict=True):
        colour = np.where(np.isnan(values)[:, None], MISSING, colours(norm(values))[:, :3])
        for axis, (face, shade) in zip(line[:2], pictures, strict=True):
            image = np.ones((*face.shape, 3))
            image[face >= 0] = colour[face[face >= 0]] * shade[face >= 0, None]
            axis.imshow(image, interpolation="antialiased")
            axis.set_axis_off()
        _draw_plane(line[2], state, colour)
        bar = figure.colorbar(
            mpl.cm.ScalarMappable(norm, colours),
            ax=line,
            shrink=0.8,
            extend="max" if norm.vmin == 1 else "both",
            pad=0.01,
        )
        ticks = _ticks(norm)
        bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
        bar.minorticks_off()
        bar.set_label(label)
    for axis, heading in zip(
        axes[0], ("surface, one side", "surface, other side", "UV plane"), strict=True
    ):
        axis.set_title(heading, fontsize=11)
    figure.suptitle(f"{title}: distortion of {faces:,} faces")
    figure.savefig(path, format="png")


def _scale_end(ratios: FloatArray) -> float:
    """The first of LARGEST_RATIOS that 95 % of the ratios (each at least 1) do not exceed."""
    if not len(ratios):
        return LARGEST_RATIOS[0]
    high = np.partition(ratios, int(0.95 * (len(ratios) - 1)))[int(0.95 * (len(ratios) - 1))]
    return next((end for end in LARGEST_RATIOS if end >= high), LARGEST_RATIOS[-1])


def _ticks(norm: Normalize) -> list[float]:
    """Five ticks, evenly spread on the logarithmic scale, of three digits."""
    assert norm.vmin is not None
    assert norm.vmax is not None
    return [float(f"{tick:.3g}") for tick in np.geomspace(norm.vmin, norm.vmax, 5)]


def _visible(mesh: Mesh, towards: FloatArray) -> tuple[IntArray, FloatArray]:
    """The face seen at each pixel (-1 for none) and how brightly it is lit, (PIXELS, PIXELS)."""
    back = towards / np.linalg.norm(towards)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    vertices = mesh.vertices - mesh.vertices[mesh.faces].reshape(-1, 3).mean(axis=0)
    flat = vertices[np.unique(mesh.faces)] @ np.stack([right, up]).T
    centre = (flat.min(axis=0) + flat.max(axis=0)) / 2
    half = float(np.ptp(flat, axis=0).max()) / 2 * 1.03 or 1.0
    step = np.linspace(-half, half, PIXELS)
    x, y = np.meshgrid(centre[0] + step, centre[1] - step)
    depth = float(np.linalg.norm(vertices, axis=1).max()) * 2 + half
    origins = x.reshape(-1, 1) * right + y.reshape(-1, 1) * up + depth * back
    tree = igl.AABB()
    tree.init(vertices, mesh.faces)
    directions = np.tile(-back, (len(origins), 1))
    face, _, _ = tree.intersect_ray_first(vertices, mesh.faces, origins, directions)
    a, b, c = (vertices[mesh.faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    facing = np.abs(normal @ back) / np.where(length > 0, length, 1.0)
    # Both sides are lit alike, from the eye; shade stays light, so that colours can be compared.
    shade = np.where(face >= 0, 0.55 + 0.45 * facing[face], 1.0)
    return face.reshape(PIXELS, PIXELS), shade.reshape(PIXELS, PIXELS)


def _draw_plane(axis: Any, state: MapState, colour: FloatArray) -> None:
    """The UV layout; faces that span a seam lie below, as outlines, since they cover the others."""
    images = state.parameterization.uv[state.parameterization.corners]
    spanning = state.spanning
    axis.add_collection(
        PolyCollection(
            list(images[spanning]), facecolors="none", edgecolors=OUTLINE, linewidths=0.3
        )
    )
    # Smoothed sides would let the paper shine through between neighbours.
    axis.add_collection(
        PolyCollection(
            list(images[~spanning]), facecolors=colour[~spanning], linewidths=0, antialiaseds=False
        )
    )
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.tick_params(labelsize=7)
