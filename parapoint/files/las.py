"""LAS and LAZ, by laspy: bytes in, `Content` without faces out."""

from __future__ import annotations

import io
import logging
import struct

import numpy as np

from parapoint.errors import InputError
from parapoint.files.attributes import named_attributes
from parapoint.files.content import Content, points_content
from parapoint.files.decoding import check_decoded

NOISE = (7, 18)
"""Classes of points that are noise, low and high, by the LAS specification."""

logger = logging.getLogger("parapoint")


def las(data: bytes) -> Content:
    """LAS, and LAZ where laspy has a decoder: scaled coordinates of all points."""
    import laspy

    if data[:4] != b"LASF":
        raise InputError("has no LAS header")
    if data[24:25] != b"\x01":  # laspy goes by the minor version alone
        raise InputError(f"is of LAS version {data[24]}.{data[25]}; 1.0 to 1.4 are read")
    # laspy makes room for whatever the header announces, be it four thousand million points.
    start, records, kind, width, points = struct.unpack_from("<IIBHI", data, 96)
    extended = 0
    if data[24:26] >= b"\x01\x04":
        extended, points = struct.unpack_from("<IQ", data, 243)
    compressed = kind >= 128
    if not compressed and start + width * points > len(data):
        raise InputError(f"ends early: {points} points are announced")
    if 54 * records + 60 * extended > len(data):
        raise InputError(f"ends early: {records + extended} variable records are announced")
    check_decoded(width * points, len(data))
    if compressed and not laspy.LazBackend.detect_available():
        raise InputError("is LAZ, which needs a decoder; pip install lazrs")
    try:
        read = laspy.read(io.BytesIO(data))
    except laspy.LaspyException as error:
        raise InputError(f"cannot be read by laspy ({error})") from error
    kept = np.ones(len(read.points), dtype=bool)
    if len(kept):
        kept = ~np.isin(read.classification, NOISE) & (np.asarray(read.withheld) == 0)
    if len(kept) and not kept.any():
        raise InputError("has no point that is neither noise nor withheld")
    if not kept.all():
        logger.warning(
            "%d of %d points left out: classed as noise, or withheld", (~kept).sum(), len(kept)
        )
    names = [name for name in read.point_format.dimension_names if name not in "XYZ"]
    columns = {name: np.asarray(read[name])[kept] for name in names}
    if all(name in columns and not columns[name].any() for name in ("red", "green", "blue")):
        for name in ("red", "green", "blue"):  # room for colours that were never taken
            del columns[name]
    with np.errstate(over="ignore"):  # a coordinate that leaves the numbers is dropped, and counted
        points = np.asarray(read.xyz, dtype=np.float64)[kept]
    return points_content(points, attributes=named_attributes(columns))
