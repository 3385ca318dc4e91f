"""PCD of the Point Cloud Library: bytes in, `Content` without faces out.

Ours: the packages that read the format bring a validation framework and a compiled LZF module for
what is a header and a table.
"""

from __future__ import annotations

import struct

import numpy as np

from parapoint.errors import InputError
from parapoint.files.content import Content, points_content
from parapoint.files.xyz import table, text_lines


def pcd(data: bytes) -> Content:
    """PCD of the Point Cloud Library: ascii, binary and binary_compressed."""
    fields, kinds, counts, count, encoding, body = _pcd_header(data)
    wanted = ["x", "y", "z"]
    if not set(wanted) <= set(fields):
        raise InputError("has no fields x, y and z")
    if {"normal_x", "normal_y", "normal_z"} <= set(fields):
        wanted += ["normal_x", "normal_y", "normal_z"]
    places = [fields.index(name) for name in wanted]
    if any(counts[place] != 1 for place in places):
        raise InputError("has more than one value in a coordinate field")
    widths = [kind.itemsize * n for kind, n in zip(kinds, counts, strict=True)]
    offsets = np.cumsum([0, *widths]).tolist()
    size = count * sum(widths)
    if encoding == "ascii":
        columns = np.cumsum([0, *counts]).tolist()
        values = table(text_lines(body)[:count], tuple(columns[place] for place in places))
        if len(values) != count:
            raise InputError(f"ends early: {count} points are announced, {len(values)} follow")
    else:
        if encoding == "binary_compressed":
            packed, unpacked = struct.unpack_from("<II", body)
            if unpacked != size:
                raise InputError(f"holds {unpacked} bytes for {count} points of {size} bytes")
            body = lzf_decompressed(body[8 : 8 + packed], size)
            offsets = [count * offset for offset in offsets]  # one field after the other
            strides = [kind.itemsize for kind in kinds]
        else:
            strides = [sum(widths)] * len(kinds)
        if len(body) < size:
            raise InputError(f"ends early: {count} points take {size} bytes")
        values = np.stack(
            [
                np.ndarray((count,), kinds[p], body, offsets[p], (strides[p],)).astype(np.float64)
                for p in places
            ],
            axis=1,
        )
    return points_content(values[:, :3], values[:, 3:] if len(wanted) == 6 else None)


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
