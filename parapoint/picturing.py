"""Pictures of a fitted model: a figure to restyle, and a thumbnail for notebooks."""

from __future__ import annotations

import base64
import html as markup
import io
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import BoolArray, FloatArray
from parapoint.textures.checkerboard import checkerboard
from parapoint.textures.placing import Placing
from parapoint.textures.preview import preview

if TYPE_CHECKING:
    from matplotlib.figure import Figure

THUMBNAIL = (480, 160)
"""Width and height in pixels of the picture in a notebook."""
MOST_DRAWN = 20_000
"""Points that a figure draws at most."""
FLATTEST = 0.01
"""Least extent of the drawn box along an axis, as a share of its largest one."""


def figure(points: FloatArray, uv: FloatArray, on_seam: BoolArray) -> Figure:
    """A figure with points on the left, and their map on the right.

    A point has the same colour on both sides, and points on a seam are black. Its axes and their
    collections are matplotlib's own: change what you like.

    Args:
        points: (N, 3) points; some of them are drawn if there are more than MOST_DRAWN.
        uv: (N, 2) their images.
        on_seam: (N,) whether each lies on a seam.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise InputError("a plot needs matplotlib: pip install matplotlib") from None

    class Plot(Figure):
        """A figure that a notebook shows by itself, without pyplot."""

        def _repr_png_(self) -> bytes:
            file = io.BytesIO()
            self.savefig(file, format="png")
            return file.getvalue()

    drawn = slice(None, None, len(points) // MOST_DRAWN + 1)
    points, uv = points[drawn], uv[drawn]
    colours = np.where(on_seam[drawn, None], 0.0, _hues(uv))
    made = Plot(figsize=(9, 4.5), layout="constrained")
    space = made.add_subplot(1, 2, 1, projection="3d")
    space.scatter(points[:, 0], points[:, 1], points[:, 2], c=colours, s=2)
    extent = np.ptp(points, axis=0)
    space.set_box_aspect(np.maximum(extent, FLATTEST * extent.max()))
    plane = made.add_subplot(1, 2, 2)
    plane.scatter(uv[:, 0], uv[:, 1], c=colours, s=2)
    plane.set_aspect("equal")
    for axes, title in ((space, "surface"), (plane, "map")):
        axes.set_title(title)
        axes.set_axis_off()
    return made


def _hues(uv: FloatArray) -> FloatArray:
    """(N, 3) colours from 0 to 1 that vary smoothly over the places (N, 2) of a plane."""
    at = (uv - np.nanmin(uv, axis=0)) / np.nanmax(np.ptp(uv, axis=0))
    right, up = at.T
    hues = np.stack([right, 0.5 - 0.3 * up, 1 - right * up], axis=1)
    return np.asarray(np.clip(hues, 0, 1))


def html(text: str, charted: Charted | None) -> str:
    """A text as code, and below it a picture of a mesh and its map, if there is one."""
    said = f"<code>{markup.escape(text)}</code>"
    if charted is None:
        return said
    shown = preview(Placing.smallest(charted.map.uv).of(charted), checkerboard())
    file = io.BytesIO()
    Image.fromarray(shown).resize(THUMBNAIL, Image.Resampling.LANCZOS).save(file, "PNG")
    data = base64.b64encode(file.getvalue()).decode()
    return f'{said}<br><img alt="the surface and its map" src="data:image/png;base64,{data}">'
