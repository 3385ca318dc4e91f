"""LAS and LAZ, by laspy: bytes in, `Content` without faces out."""

from __future__ import annotations

import io
import logging
import math
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from parapoint.errors import InputError
from parapoint.files.attributes import named_attributes, taken_normals
from parapoint.files.content import Content, points_content
from parapoint.files.decoding import check_decoded, plain

NOISE = (7, 18)
"""Classes of points that are noise, low and high, by the LAS specification."""

HEADER = 375
"""Bytes of the longest header, that of version 1.4."""

if TYPE_CHECKING:
    import laspy

logger = logging.getLogger("parapoint")


def las(data: bytes) -> Content:
    """LAS, and LAZ where laspy has a decoder: scaled coordinates of all points."""
    import laspy

    check_header(data[:HEADER], len(data))
    with _faults():
        read = laspy.read(io.BytesIO(data))
    content = _content(read.points)
    _warn_of_noise(len(content.vertices), len(read.points))
    colours = content.attributes.get("colours")
    if colours is not None and not colours.any():  # room for colours that were never taken
        del content.attributes["colours"]
    return content


def las_pieces(path: Path, size: int) -> Iterator[Content]:
    """What `las` reads of a file, at most `size` points at a time, for files of any length.

    Where the points have room for colours, pieces have colours, though they be black.

    Raises:
        InputError: as by `las`.
    """
    import laspy

    with path.open("rb") as stream:
        check_header(plain(stream.read(HEADER)), path.stat().st_size)
    kept = 0
    with _faults(), laspy.open(path, read_evlrs=False) as file:
        for points in file.chunk_iterator(size):
            content = _content(points)
            kept += len(content.vertices)
            yield content
        count = file.header.point_count
    _warn_of_noise(kept, count)


@contextmanager
def _faults() -> Iterator[None]:
    """What laspy says becomes an InputError, and nothing else is said of it."""
    import laspy

    logging.getLogger("laspy").setLevel(logging.CRITICAL + 1)
    try:
        yield
    except laspy.LaspyException as error:
        raise InputError(f"cannot be read by laspy ({error})") from error


def _content(points: laspy.ScaleAwarePointRecord) -> Content:
    """The points that are neither noise nor withheld, and what is known of them."""
    kept = np.ones(len(points), dtype=bool)
    if len(kept):
        kept = ~np.isin(points["classification"], NOISE) & (np.asarray(points["withheld"]) == 0)
    names = [name for name in points.point_format.dimension_names if name not in "XYZ"]
    columns = {name: np.asarray(points[name])[kept] for name in names}
    # A coordinate that leaves the numbers is dropped later, and counted.
    with np.errstate(over="ignore", invalid="ignore"):
        places = [np.asarray(points[axis], dtype=np.float64)[kept] for axis in "xyz"]
    normals = taken_normals(columns)
    content = points_content(np.stack(places, axis=1), normals, named_attributes(columns))
    content.rows = None if kept.all() else np.flatnonzero(kept)
    return content


def _warn_of_noise(kept: int, count: int) -> None:
    """Say how many points were left out.

    Raises:
        InputError: these were all.
    """
    if count and not kept:
        raise InputError("has no point that is neither noise nor withheld")
    if kept < count:
        logger.warning(
            "%d of %d points left out: classed as noise, or withheld", count - kept, count
        )


def check_header(head: bytes, length: int) -> None:
    """Check that a file holds what its header announces, before laspy makes room for it.

    Args:
        head: the first HEADER bytes of the file.
        length: bytes of the whole file.

    Raises:
        InputError: it does not; or it is packed (LAZ), and there is no decoder.
    """
    import laspy

    if head[:4] != b"LASF":
        raise InputError("has no LAS header")
    if head[24:25] != b"\x01":  # laspy goes by the minor version alone
        raise InputError(f"is of LAS version {head[24]}.{head[25]}; 1.0 to 1.4 are read")
    for axis, scale in zip("xyz", struct.unpack_from("<3d", head, 131), strict=True):
        if scale == 0 or not math.isfinite(scale):
            raise InputError(f"has the scale {scale:g} for {axis}, by which no place can be told")
    # laspy makes room for whatever the header announces, be it four thousand million points.
    start, records, kind, width, points = struct.unpack_from("<IIBHI", head, 96)
    extended = 0
    if head[24:26] >= b"\x01\x04":
        extended, points = struct.unpack_from("<IQ", head, 243)
    compressed = kind >= 128
    if not compressed and start + width * points > length:
        raise InputError(f"ends early: {points} points are announced")
    room = (length - start) // max(width, 1)
    if not compressed and head[25] < 3 and room > points:  # later ones may have more behind them
        logger.warning("points announced: %d; the file has room for %d", points, room)
    if 54 * records + 60 * extended > length:
        raise InputError(f"ends early: {records + extended} variable records are announced")
    check_decoded(width * points, length)
    if compressed and not laspy.LazBackend.detect_available():
        raise InputError("is LAZ, which needs a decoder; pip install lazrs")
