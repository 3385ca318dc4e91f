"""What stands between a file's bytes and its reader: packing, text encodings, and their bounds."""

from __future__ import annotations

import math
import os
import typing
from contextvars import ContextVar

from numpy.lib.npyio import NpzFile

from parapoint.errors import InputError

PACKED = {
    b"\x1f\x8b": "gzip",
    b"\x28\xb5\x2f\xfd": "zstd",
    b"BZh": "bzip2",
    b"\xfd7zXZ": "xz",
    b"PK\x03\x04": "zip",
    b"7z\xbc\xaf": "7z",
}
"""First bytes of packed files, by the name of the tool that unpacks them."""
MARKS = {
    b"\xff\xfe\x00\x00": "utf-32",
    b"\x00\x00\xfe\xff": "utf-32",
    b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}
"""Byte order marks that begin a text, and its encoding."""
DECODED_LEAST = 64 * 2**20
"""Every file may decode to this many bytes."""
DECODED_TIMES = 32
"""A file may also decode to this many times its own size."""

_allowed: ContextVar[float] = ContextVar("_allowed", default=DECODED_LEAST)


def plain(data: bytes) -> bytes:
    """The data without a byte order mark, and as UTF-8 where they were UTF-16 or UTF-32.

    Raises:
        InputError: the data are empty or packed by another tool; the message names it.
    """
    for first, tool in PACKED.items():
        if data.startswith(first):
            raise InputError(f"is packed by {tool}; unpack it first")
    for mark, encoding in MARKS.items():
        if data.startswith(mark):
            try:
                data = data.decode(encoding).encode()
            except UnicodeDecodeError:
                break  # a binary file that happens to begin so
    data = data.removeprefix(b"\xef\xbb\xbf")
    if not data.strip():
        raise InputError("is empty")
    return data


def allow(size: float) -> None:
    """From here on let every file decode to `size` bytes, in place of DECODED_LEAST."""
    _allowed.set(max(size, DECODED_LEAST))


def allowed() -> float:
    """Bytes that every file may decode to from here on."""
    return _allowed.get()


def check_decoded(size: int, file_size: int) -> None:
    """Check, before any memory is taken, that a file decodes to no more than it may.

    Args:
        size: bytes that it decodes to.
        file_size: bytes of the file.

    Raises:
        InputError: that is more than is allowed, and than DECODED_TIMES the file's own size.
    """
    if size > max(_allowed.get(), DECODED_TIMES * file_size):
        gigabytes = math.ceil(size / 1e9)
        raise InputError(
            f"has {file_size:,} bytes that decode to {size:,}, more than {DECODED_TIMES} times as "
            f"much; unpack it by the tool that wrote it, or allow --memory {gigabytes} GB"
        )


def opened_archive(stream: typing.IO[bytes]) -> NpzFile:
    """The npz file in a stream, checked as `check_decoded` does before any array is read.

    Raises:
        InputError: the arrays are larger than is allowed.
        zipfile.BadZipFile: the stream is no archive.
    """
    file_size = stream.seek(0, os.SEEK_END)
    archive = NpzFile(stream, allow_pickle=False)
    assert archive.zip is not None  # it is until the file is closed
    check_decoded(sum(item.file_size for item in archive.zip.infolist()), file_size)
    return archive
