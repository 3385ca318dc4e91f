"""PNG files, of 8 and of 16 bits; the imaging libraries at hand write no colours of 16 bits."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError

COLOUR_TYPES = {1: 0, 3: 2, 4: 6}
"""PNG's code for grey, RGB and RGBA, by the number of channels."""


def png(pixels: npt.NDArray[np.uint8 | np.uint16], text: dict[str, str] | None = None) -> bytes:
    """A PNG file.

    Args:
        pixels: (H, W, c) uint8 or uint16, c = 1 grey, 3 RGB or 4 RGBA; first row at the top.
        text: keywords and what they say (Latin-1), as tEXt chunks.

    Raises:
        InputError: another shape or type.
    """
    fits = pixels.ndim == 3 and pixels.shape[2] in COLOUR_TYPES and pixels.size > 0
    if not fits or pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(
            "a texture must be (H, W, 1, 3 or 4) pixels, uint8 or uint16, "
            f"not {pixels.shape} {pixels.dtype}"
        )
    height, width, channels = pixels.shape
    raw = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(">"), copy=False))
    lines = raw.view(np.uint8).reshape(height, -1)
    rows = np.full((height, 1 + lines.shape[1]), 2, dtype=np.uint8)  # filter 2: less the row above
    rows[0, 1:] = lines[0]
    np.subtract(lines[1:], lines[:-1], out=rows[1:, 1:])

    def chunk(kind: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    bits = 8 * pixels.dtype.itemsize
    header = struct.pack(">IIBBBBB", width, height, bits, COLOUR_TYPES[channels], 0, 0, 0)
    said = [chunk(b"tEXt", f"{key}\0{of}".encode("latin-1")) for key, of in (text or {}).items()]
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            chunk(b"IHDR", header),
            *said,
            chunk(b"IDAT", zlib.compress(rows.tobytes(), 5)),
            chunk(b"IEND", b""),
        ]
    )
