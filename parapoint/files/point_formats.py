"""Readers of point-cloud files: XYZ, PTS, PCD and LAS; bytes in, `Content` without faces out.

The PCD reader is our own: the packages that read the format bring a validation framework and a
compiled LZF module for what is a header and a table. See `parapoint.files.mesh_formats` for what is
raised on bytes that are no such file.
"""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.mesh_formats import Content, colours_of, named_attributes, points_content
from parapoint.surfaces.surface import FloatArray


def table(lines: list[bytes], columns: tuple[int, ...]) -> FloatArray:
    """(n, len(columns)) numbers in these columns of text lines; empty for no lines."""
    if not lines:
        return np.zeros((0, len(columns)))
    text = (line.decode("latin-1") for line in lines)  # no second copy of millions of lines
    return np.loadtxt(text, comments="#", usecols=columns, ndmin=2, dtype=np.float64)


def text_lines(data: bytes) -> list[bytes]:
    """Lines that hold more than blanks and comments, commas turned into blanks."""
    return [
        line
        for line in data.replace(b",", b" ").splitlines()
        if line.strip() and not line.lstrip().startswith((b"#", b"//"))
    ]


def xyz(data: bytes) -> Content:
    """Text with x y z in each line, and whatever columns a scanner adds; see `_further_columns`."""
    lines = text_lines(data)
    if lines and len(lines[0].split()) == 1:
        lines = lines[1:]  # a count on its own, as scanners write it
    if not lines:
        raise InputError("has no point")
    try:
        values = table(lines, tuple(range(len(lines[0].split()))))
    except ValueError:  # words, or not in all lines: the coordinates alone
        values = table(lines, (0, 1, 2))
    if values.shape[1] < 3:
        raise InputError("has fewer than three numbers in a line")
    return points_content(values[:, :3], *_further_columns(values))


def _further_columns(
    values: FloatArray,
) -> tuple[FloatArray | None, dict[str, npt.NDArray[Any]]]:
    """Normals, or None, and attributes in the columns behind x y z of (P, 3 + k) numbers.

    Three columns together are normals where all have length 1, and colours where all are whole
    numbers from 0 to 255 or fractions from 0 to 1. Single columns come before them, as in PTS: the
    first is the intensity.
    """
    finite = np.isfinite(values).all(axis=1)
    normals: FloatArray | None = None
    attributes: dict[str, npt.NDArray[Any]] = {}
    columns = values.shape[1]
    single = (columns - 3) % 3
    for at in range(3, 3 + single):
        attributes["intensity" if at == 3 else f"column{at + 1}"] = values[:, at]
    for at in range(3 + single, columns, 3):
        three = values[:, at : at + 3]
        length = np.linalg.norm(np.clip(three[finite], -2, 2), axis=1)  # clipped: no overflow
        colours = colours_of(three)
        if normals is None and len(length) and (np.abs(length - 1) < 1e-3).all():
            normals = three
        elif "colours" not in attributes and colours is not None and colours.dtype != np.uint16:
            attributes["colours"] = colours
        else:
            attributes |= {f"column{at + k + 1}": three[:, k] for k in range(3)}
    return normals, attributes


def pts(data: bytes) -> Content:
    """PTS: lines "p x y z" (Hoppe), or a count and then x y z and what a scanner adds."""
    lines = text_lines(data)
    marked = [line for line in lines if line.startswith(b"p ")]
    return points_content(table(marked, (1, 2, 3))) if marked else xyz(data)


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


def pcd(data: bytes) -> Content:
    """PCD of the Point Cloud Library: ascii, binary and binary_compressed."""
    fields, kinds, counts, count, encoding, body = _pcd_header(data)
    if not {"x", "y", "z"} <= set(fields):
        raise InputError("has no fields x, y and z")
    if any(counts[fields.index(axis)] != 1 for axis in "xyz"):
        raise InputError("has more than one value in a coordinate field")
    widths = [kind.itemsize * n for kind, n in zip(kinds, counts, strict=True)]
    offsets = np.cumsum([0, *widths]).tolist()
    size = count * sum(widths)
    wanted = [k for k, name in enumerate(fields) if counts[k] == 1 and name != "_"]
    if encoding == "ascii":
        places = np.cumsum([0, *counts]).tolist()
        values = table(text_lines(body)[:count], tuple(places[k] for k in wanted))
        if len(values) != count:
            raise InputError(f"ends early: {count} points are announced, {len(values)} follow")
        columns = {
            fields[k]: values[:, at].astype(kinds[k] if fields[k] in PACKED else np.float64)
            for at, k in enumerate(wanted)
        }
    else:
        strides = [sum(widths)] * len(kinds)
        if encoding == "binary_compressed":
            packed, unpacked = struct.unpack_from("<II", body)
            if unpacked != size:
                raise InputError(f"holds {unpacked} bytes for {count} points of {size} bytes")
            body = lzf_decompressed(body[8 : 8 + packed], size)
            offsets = [count * offset for offset in offsets]  # one field after the other
            strides = [kind.itemsize for kind in kinds]
        if len(body) < size:
            raise InputError(f"ends early: {count} points take {size} bytes")
        columns = {
            fields[k]: np.ndarray((count,), kinds[k], body, offsets[k], (strides[k],)).copy()
            for k in wanted
        }
    points = np.stack([columns.pop(axis) for axis in "xyz"], axis=1).astype(np.float64)
    normals = None
    if set(PCD_NORMALS) <= set(columns):
        normals = np.stack([columns.pop(name) for name in PCD_NORMALS], axis=1).astype(np.float64)
    return points_content(points, normals, _pcd_attributes(columns))


PACKED = {"rgb": 3, "rgba": 4}
"""Fields that hold the bytes blue, green, red (and alpha) of a colour, and how many count."""
PCD_NORMALS = ("normal_x", "normal_y", "normal_z")


def _pcd_attributes(columns: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
    """Attributes of PCD fields, packed colours unpacked."""
    attributes = {}
    for name, parts in PACKED.items():
        if name in columns and columns[name].dtype.itemsize == 4:
            four = np.ascontiguousarray(columns.pop(name)).view(np.uint8).reshape(-1, 4)
            colours = four[:, [2, 1, 0, 3][:parts]]
            # Many writers leave alpha at 0 throughout, and mean opaque.
            attributes["colours"] = colours[:, :3] if not four[:, 3].any() else colours
    return attributes | named_attributes(columns)


def _pcd_header(
    data: bytes,
) -> tuple[list[str], list[np.dtype[np.generic]], list[int], int, str, bytes]:
    """Field names, types and counts, number of points, encoding, and the bytes behind."""
    header: dict[str, list[str]] = {}
    rest = data
    while "DATA" not in header:
        line, newline, rest = rest.partition(b"\n")
        words = line.decode("latin-1").split()
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
        if not newline:
            raise InputError("has no PCD header")
    fields = header["FIELDS"]
    codes = {"F": "f", "I": "i", "U": "u"}
    kinds = [
        np.dtype(f"<{codes[kind]}{int(size)}")
        for kind, size in zip(header["TYPE"], header["SIZE"], strict=True)
    ]
    counts = [int(word) for word in header.get("COUNT", ["1"] * len(fields))]
    if not len(fields) == len(kinds) == len(counts) or min(counts, default=0) < 1:
        raise InputError("has a header whose FIELDS, SIZE, TYPE and COUNT do not agree")
    count = int(header["POINTS"][0])
    encoding = header["DATA"][0].lower()
    if count < 0 or encoding not in {"ascii", "binary", "binary_compressed"}:
        raise InputError(f"has {count} points in encoding {encoding[:30]!r}, which is not read")
    return fields, kinds, counts, count, encoding, rest


def lzf_decompressed(data: bytes, size: int) -> bytes:
    """`size` bytes from Marc Lehmann's LZF format: literal runs and copies of earlier bytes."""
    out = bytearray()
    at = 0
    while at < len(data) and len(out) <= size:
        control = data[at]
        at += 1
        if control < 32:
            out += data[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += data[at]
            at += 1
        length += 2
        distance = ((control & 31) << 8) + data[at] + 1
        at += 1
        start = len(out) - distance
        if start < 0:
            raise InputError("has broken compressed data")
        copied = out[start : start + length]
        out += (copied * (length // len(copied) + 1))[:length]  # a copy may overlap itself
    if len(out) != size:
        raise InputError(f"has broken compressed data: {len(out)} bytes where {size} belong")
    return bytes(out)
