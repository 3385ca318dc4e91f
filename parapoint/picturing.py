"""Pictures of a fitted model: a figure to restyle, and a thumbnail for notebooks."""

from __future__ import annotations

import base64
import html as markup
import io
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from parapoint.errors import InputError
from parapoint.surfaces.surface import FloatArray
from parapoint.textures.checkerboard import checkerboard
from parapoint.textures.placing import Placing
from parapoint.textures.preview import preview

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from parapoint.estimator import Estimator

THUMBNAIL = (480, 160)
"""Width and height in pixels of the picture in a notebook."""
MOST_DRAWN = 20_000
"""Points that a figure draws at most."""


def figure(model: Estimator) -> Figure:
    """A figure with the fitted points on the left, and their map on the right.

    A point has the same colour on both sides, and points on a seam are black. Its axes and their
    collections are matplotlib's own: change what you like.

    Raises:
        NotFittedError: the model is not fitted.
        InputError: matplotlib is not installed.
    """
    points = model.points_
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise InputError("a plot needs matplotlib: pip install matplotlib") from None
    points = points[:: len(points) // MOST_DRAWN + 1]
    uv, seam = model.transform(points), model.seams(points)
    colours = np.where(seam[:, None], 0.0, _hues(uv))
    made = Figure(figsize=(9, 4.5), layout="constrained")
    space = made.add_subplot(1, 2, 1, projection="3d")
    space.scatter(points[:, 0], points[:, 1], points[:, 2], c=colours, s=2)
    space.set_box_aspect(np.ptp(points, axis=0))
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


def html(model: Estimator) -> str:
    """The parameters of an estimator, and below them a picture of its map if it is fitted."""
    said = f"<code>{markup.escape(repr(model))}</code>"
    if not model.__sklearn_is_fitted__():
        return said
    charted = model.mesh()
    shown = preview(Placing.smallest(charted.map.uv).of(charted), checkerboard())
    file = io.BytesIO()
    Image.fromarray(shown).resize(THUMBNAIL, Image.Resampling.LANCZOS).save(file, "PNG")
    data = base64.b64encode(file.getvalue()).decode()
    return f'{said}<br><img alt="the surface and its map" src="data:image/png;base64,{data}">'
