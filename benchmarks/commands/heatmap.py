"""Draws the distortion of a map face by face, on the surface and in the UV plane."""

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
"""Side of each picture of the surface, in pixels."""
LARGEST_RATIOS = (1.05, 1.2, 1.5, 2.0, 4.0, 10.0, 100.0)
"""Ratios at which a colour scale may end. It ends at the first that 95 % of the faces do not
exceed."""
CONFORMAL_COLOURS, AREA_COLOURS = "YlGnBu", "PuOr"
"""Colour maps in which light is ideal. Colour-blind readers can tell their colours apart."""
MISSING = (0.6, 0.6, 0.6)
"""Colour of faces that are degenerate in 3D and so have no distortion."""
OUTLINE = (0.5, 0.5, 0.5, 0.25)
"""Colour of the outlines of faces that span a seam."""
VIEWS = (np.array([0.55, 0.35, 1.0]), np.array([-0.55, 0.35, -1.0]))
"""Directions from the surface to the eye; y is up."""


def write_heatmap(state: MapState, path: Path, *, title: str) -> None:
    """Draw conformal and area distortion of every face, from two sides and in the UV plane.

    Raises:
        InputError: the path does not end in .png.
        OSError: the file cannot be written.
    """
    if path.suffix.lower() != ".png":
        raise InputError(f"{path}: the heatmap is a PNG; give a name that ends in .png")
    faces, distortion = len(state.mesh.faces), state.distortion
    conformal, ratio = np.full(faces, np.nan), np.full(faces, np.nan)
    conformal[distortion.faces] = distortion.quasi_conformal
    ratio[distortion.faces] = distortion.area_ratio
    # Both scales are logarithmic. A value beyond an end has the colour of that end.
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
    """Five values with three digits, spread evenly over a logarithmic scale."""
    assert norm.vmin is not None
    assert norm.vmax is not None
    return [float(f"{tick:.3g}") for tick in np.geomspace(norm.vmin, norm.vmax, 5)]


def _visible(mesh: Mesh, towards: FloatArray) -> tuple[IntArray, FloatArray]:
    """(PIXELS, PIXELS) the face seen at each pixel, -1 for none, and how brightly it is lit."""
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
    # Light comes from the eye and falls on both sides alike. Shades stay light enough that colours
    # can be compared.
    shade = np.where(face >= 0, 0.55 + 0.45 * facing[face], 1.0)
    return face.reshape(PIXELS, PIXELS), shade.reshape(PIXELS, PIXELS)


def _draw_plane(axis: Any, state: MapState, colour: FloatArray) -> None:
    """Draw the UV layout. Faces that span a seam would hide others: they are outlines below."""
    images = state.parameterization.uv[state.parameterization.corners]
    spanning = state.spanning
    axis.add_collection(
        PolyCollection(
            list(images[spanning]), facecolors="none", edgecolors=OUTLINE, linewidths=0.3
        )
    )
    # Antialiased sides would let the background show between neighbouring faces.
    axis.add_collection(
        PolyCollection(
            list(images[~spanning]), facecolors=colour[~spanning], linewidths=0, antialiaseds=False
        )
    )
    axis.autoscale_view()
    axis.set_aspect("equal")
    axis.tick_params(labelsize=7)
