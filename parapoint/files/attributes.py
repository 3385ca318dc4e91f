"""The attributes of points, such as colours and intensity, under the names that files give them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

GEOMETRY = {"x", "y", "z", "nx", "ny", "nz"}
COLOUR_COLUMNS = (
    ("red", "green", "blue", "alpha"),
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
"""Names under which the parts of a colour stand."""
INTENSITIES = {"intensity", "scalar_intensity", "reflectance", "scalar_reflectance"}
"""Names under which the strength of a scanner's echo stands, in lower case."""


def named_attributes(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Attributes of columns (P,) by name: red, green, blue (and alpha) are one, "colours".

    Coordinates and normals are left out. Scanners' names of the intensity become "intensity".
    """
    left = {name: of for name, of in columns.items() if name not in GEOMETRY}
    attributes = {}
    for names in COLOUR_COLUMNS:
        if all(name in left for name in names):
            chosen = [left.pop(name) for name in names]
            colours = colours_of(np.stack(chosen, axis=1))
            if colours is not None:
                attributes["colours"] = colours
            break
    for name, values in left.items():
        attributes["intensity" if name.lower() in INTENSITIES else name] = values
    return attributes


def colours_of(values: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """(P, 3 or 4) numbers of any type as colours (see `PointCloud`); None where they are none.

    Numbers of 16 bits none of which is over 255 are of 8 bits; so are whole floats over 1.
    """
    least, most = (float(of(values, initial=0)) for of in (np.min, np.max))
    if not (least >= 0 and math.isfinite(most)):  # not so either where one is NaN
        return None
    if values.dtype.kind == "f":
        if most <= 1:
            return values
        if most > 65535 or (np.floor(values) != values).any():
            return None
    elif most > 65535:
        return None
    if values.dtype == np.uint8:
        return values
    return values.astype(np.uint8 if most <= 255 else np.uint16)


def srgb(linear: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Parts of linear colours, from 0 to 1, as parts of sRGB."""
    low = 12.92 * linear
    return np.where(linear <= 0.0031308, low, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def unit_colours(colours: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Colours (see `PointCloud`) as fractions."""
    most = 1.0 if colours.dtype.kind == "f" else float(np.iinfo(colours.dtype).max)
    return np.asarray(colours / np.float32(most), dtype=np.float32)
