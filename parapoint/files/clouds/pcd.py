"""PCD of the Point Cloud Library: bytes in, `Content` without faces out.

Ours: the packages that read the format bring a validation framework and a compiled LZF module for
what is a header and a table.
"""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import named_attributes, taken_normals
from parapoint.files.clouds.xyz import table, text_lines
from parapoint.files.content import Content, points_content, word_counts
from parapoint.files.decoding import check_decoded
from parapoint.surfaces.surface import FloatArray

PACKED = {"rgb": 3, "rgba": 4}
"""Fields that hold the bytes blue, green, red (and alpha) of a colour, and how many count."""


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
        lines = text_lines(body)
        _check_rows(lines, count, sum(counts))
        values = table(lines, tuple(places[k] for k in wanted))
        columns = {
            fields[k]: _packed(values[:, at], kinds[k]) if fields[k] in PACKED else values[:, at]
            for at, k in enumerate(wanted)
        }
    else:
        strides = [sum(widths)] * len(kinds)
        if encoding == "binary_compressed":
            packed, unpacked = struct.unpack_from("<II", body)
            if unpacked != size:
                raise InputError(f"holds {unpacked} bytes for {count} points of {size} bytes")
            check_decoded(size, len(body))
            body = lzf_decompressed(body[8 : 8 + packed], size)
            offsets = [count * offset for offset in offsets]  # one field after the other
            strides = [kind.itemsize * n for kind, n in zip(kinds, counts, strict=True)]
        if len(body) < size:
            raise InputError(f"ends early: {count} points take {size} bytes")
        columns = {
            fields[k]: np.ndarray((count,), kinds[k], body, offsets[k], (strides[k],)).copy()
            for k in wanted
        }
    points = np.stack([columns.pop(axis) for axis in "xyz"], axis=1).astype(np.float64)
    normals = taken_normals(columns)
    return points_content(points, normals, _pcd_attributes(columns))


def _check_rows(lines: list[bytes], count: int, width: int) -> None:
    """Check that the lines of a text file are as many as its header announces, and as long.

    Raises:
        InputError: they are not.
    """
    found = word_counts(b"\n".join(lines), len(lines))
    wrong = np.flatnonzero(found != width)
    if len(wrong):
        row = int(wrong[0])
        raise InputError(
            f"holds {found[row]} numbers in row {row} of its points (the first is row 0), and the "
            f"header announces {width}"
        )
    if len(lines) != count:
        early = "ends early: " if len(lines) < count else ""
        raise InputError(f"{early}{count} points are announced, {len(lines)} follow")


def _packed(values: FloatArray, kind: np.dtype[np.generic]) -> npt.NDArray[Any]:
    """The four bytes of packed colours, as text files have them.

    Text is a float that has these bytes or a whole number, with a sign or not, whatever its type.
    """
    is_whole = (np.floor(values) == values) & (np.abs(values) < 2**32)
    if kind.kind == "f" and not is_whole.all():
        return values.astype(np.float32)
    if not is_whole.all():
        raise InputError("has a packed colour that is no whole number of 32 bits")
    return values.astype(np.int64).astype(np.uint32)


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
    """Field names, types and counts, number of points, encoding, and the bytes behind.

    A field of COUNT 0, as lidar drivers write for padding, takes no room.
    """
    header: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in header:
        end = data.find(b"\n", at)
        if end < 0:
            raise InputError("has no PCD header")
        words = data[at:end].decode("latin-1").split()
        at = end + 1
        if words and not words[0].startswith("#"):
            header[words[0].upper()] = words[1:]
    fields = header["FIELDS" if "FIELDS" in header else "COLUMNS"]  # its name before version 0.7
    codes = {"F": "f", "I": "i", "U": "u"}
    kinds = [
        np.dtype(f"<{codes[kind]}{int(size)}")
        for kind, size in zip(header["TYPE"], header["SIZE"], strict=True)
    ]
    twice = {name for name in fields if name != "_" and fields.count(name) > 1}
    if twice:
        raise InputError(f"has the field {min(twice)!r} twice; give each a name of its own")
    counts = [int(word) for word in header.get("COUNT", ["1"] * len(fields))]
    if not len(fields) == len(kinds) == len(counts) or min(counts, default=-1) < 0:
        raise InputError("has a header whose FIELDS, SIZE, TYPE and COUNT do not agree")
    if "POINTS" in header:
        count = int(header["POINTS"][0])
    else:
        count = int(header["WIDTH"][0]) * int(header.get("HEIGHT", ["1"])[0])
    encoding = header["DATA"][0].lower()
    if count < 0 or encoding not in {"ascii", "binary", "binary_compressed"}:
        raise InputError(f"has {count} points in encoding {encoding[:30]!r}, which is not read")
    return fields, kinds, counts, count, encoding, data[at:]


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
