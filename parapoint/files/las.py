"""LAS and LAZ, by laspy: bytes in, `Content` without faces out."""

from __future__ import annotations

import io
import struct

import numpy as np

from parapoint.errors import InputError
from parapoint.files.attributes import named_attributes
from parapoint.files.content import Content, points_content


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
    read = laspy.read(io.BytesIO(data))
    names = [name for name in read.point_format.dimension_names if name not in "XYZ"]
    columns = {name: np.asarray(read[name]) for name in names}
    if all(name in columns and not columns[name].any() for name in ("red", "green", "blue")):
        for name in ("red", "green", "blue"):  # room for colours that were never taken
            del columns[name]
    points = np.asarray(read.xyz, dtype=np.float64)
    return points_content(points, attributes=named_attributes(columns))
