"""The attributes of points, such as colours and intensity, under the names that files give them."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import numpy.typing as npt

logger = logging.getLogger("parapoint")

NORMAL_COLUMNS = (
    ("nx", "ny", "nz"),
    ("normal_x", "normal_y", "normal_z"),
    ("normalx", "normaly", "normalz"),
)
"""Names under which the parts of a normal stand, in lower case: in PLY, PCD and LAS."""
GEOMETRY = {"x", "y", "z", *NORMAL_COLUMNS[0]}
COLOUR_COLUMNS = (
    ("red", "green", "blue", "alpha"),
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
    ("rf", "gf", "bf"),
)
"""Names under which the parts of a colour stand, in lower case."""
BRIGHT = 16
"""Floats under the name of a colour are meant from 0 to 255 where one of them is over this. Those
that are over 1 and not over this may as well be fractions that are too bright."""
ROUNDED = 1e-5
"""Fractions are over 1 by no more than this where single precision has rounded them."""
INTENSITIES = {"intensity", "scalar_intensity", "reflectance", "scalar_reflectance"}
"""Names under which the strength of a scanner's echo stands, in lower case."""


def named_attributes(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Attributes of columns (P,) by name: red, green, blue (and alpha) are one, "colours".

    Coordinates and normals are left out. Scanners' names of the intensity become "intensity".
    """
    left = {name: of for name, of in columns.items() if name not in GEOMETRY}
    attributes = {}
    if found := spelled_colours(list(left)):
        colours = named_colours(np.stack([left[name] for name in found], axis=1))
        if colours is not None:
            attributes["colours"] = colours
            left = {name: of for name, of in left.items() if name not in found}
    for name, values in left.items():
        attributes["intensity" if name.lower() in INTENSITIES else name] = values
    return attributes


def taken_normals(columns: dict[str, npt.NDArray[Any]]) -> npt.NDArray[np.float64] | None:
    """(P, 3) the normals among columns (P,), which are taken out of them; None without any."""
    for names in NORMAL_COLUMNS:
        if found := _spelled(list(columns), names):
            return np.stack([columns.pop(name) for name in found], axis=1).astype(np.float64)
    return None


def spelled_colours(columns: list[str]) -> list[str]:
    """The names of the parts of a colour among columns, as they are spelled; [] without any."""
    return next((found for names in COLOUR_COLUMNS if (found := _spelled(columns, names))), [])


def _spelled(columns: list[str], names: tuple[str, ...]) -> list[str]:
    """These names as the columns spell them, in capitals or not; [] where one is missing."""
    spelled = {name.lower(): name for name in columns}
    return [spelled[name] for name in names] if set(names) <= set(spelled) else []


def named_colours(values: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """(P, 3 or 4) numbers that their file calls colours, as `colours_of`, but with a warning.

    They may also be floats from 0 to 255 that are not whole; these are rounded.
    """
    colours = colours_of(values)
    if colours is None:
        least, most = _range(values)
        if least >= 0 and BRIGHT < most <= 255:
            whole: npt.NDArray[Any] = np.rint(values)
            return whole / 255 if np.isnan(values).any() else whole.astype(np.uint8)
        if values.dtype.kind == "f" and np.isnan(values).all():
            logger.warning("colours left out: none of them is a number")
            return None
        logger.warning(
            "colours left out: they go from %g to %g, but not from 0 to 1, 255 or 65535",
            least,
            most,
        )
    return colours


def colours_of(values: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """(P, 3 or 4) numbers of any type as colours (see `PointCloud`); None where they are none.

    Numbers of 16 bits none of which is over 255 are of 8 bits; so are whole floats over 1. Where
    some are not finite, as of points without a colour, these are NaN and all are fractions.
    """
    if values.dtype.kind == "f":
        values = np.where(np.isfinite(values), values, np.nan)
        if _range(values)[1] <= 1 + ROUNDED:
            values = np.minimum(values, 1)
    least, most = _range(values)
    if not (least >= 0 and most <= 65535):
        return None
    if values.dtype.kind == "f":
        unknown = np.isnan(values)
        if most <= 1:
            return None if unknown.all() else values
        if (np.floor(values) != values)[~unknown].any():
            return None
        if unknown.any():
            return values / (255 if most <= 255 else 65535)
    if values.dtype == np.uint8:
        return values
    return values.astype(np.uint8 if most <= 255 else np.uint16)


def _range(values: npt.NDArray[Any]) -> tuple[float, float]:
    """The least and the greatest of some numbers and 0; NaN has no say."""
    known = values[~np.isnan(values)] if values.dtype.kind == "f" else values
    return float(known.min(initial=0)), float(known.max(initial=0))


def srgb(linear: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Parts of linear colours, from 0 to 1, as parts of sRGB."""
    low = 12.92 * linear
    return np.where(linear <= 0.0031308, low, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def unit_colours(colours: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Colours (see `PointCloud`) as fractions."""
    most = 1.0 if colours.dtype.kind == "f" else float(np.iinfo(colours.dtype).max)
    return np.asarray(colours / np.float32(most), dtype=np.float32)
