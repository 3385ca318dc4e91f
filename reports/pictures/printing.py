"""What a figure becomes as a file: a PNG of few colours, a PDF with its pictures as JPEG."""

from __future__ import annotations

import io
import zlib
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from PIL import Image as Images
from PIL import ImageColor
from pypdf import PdfReader, PdfWriter
from pypdf.generic import DecodedStreamObject, NameObject

from parapoint.files.targets import complete_file

JPEG_QUALITY = 85
"""Of pictures in a PDF."""


def few_colours(made: Figure, paper: str, path: Path) -> None:
    """Write a figure as PNG of 256 colours, as many as the eye tells apart; `paper` stays exact."""
    content, dpi = io.BytesIO(), mpl.rcParams["savefig.dpi"]
    made.savefig(content, format="rgba", facecolor=paper)
    width, height = (int(side * dpi) for side in made.get_size_inches())
    whole = Images.frombytes("RGBA", (width, height), content.getvalue()).convert("RGB")
    colours = whole.quantize(256, method=Images.Quantize.FASTOCTREE)
    levels = np.reshape(colours.getpalette() or [], (-1, 3))
    exact = np.array(ImageColor.getrgb(paper))
    levels[(np.abs(levels - exact) < 8).all(axis=1)] = exact
    colours.putpalette(levels.reshape(-1).tolist())
    few = whole.quantize(palette=colours, dither=Images.Dither.FLOYDSTEINBERG)
    with complete_file(path) as file:
        few.save(file, format="PNG", compress_level=6, dpi=(dpi, dpi))


def on_white(picture: Any) -> Any:
    """(h, w, 4) of a picture, in bytes, as (h, w, 3) on white; other arrays as they are."""
    if picture.ndim != 3 or picture.shape[2] != 4:
        return picture
    shown = Images.fromarray(np.asarray(picture))
    white = Images.new("RGBA", shown.size, "white")
    return np.asarray(Images.alpha_composite(white, shown).convert("RGB"))


def light(document: IO[bytes]) -> bytes:
    """A PDF whose streams are plain with pictures as JPEG, which matplotlib cannot write.

    That is a fourth of the bytes. The other streams are deflated.
    """
    reader = PdfReader(document)
    for number in reader.xref[0]:
        stream = reader.get_object(number)
        if not isinstance(stream, DecodedStreamObject):
            continue
        if stream.get("/Subtype") == "/Image":
            size: Any = (stream["/Width"], stream["/Height"])
            content = io.BytesIO()
            picture = Images.frombytes("RGB", size, stream.get_data())
            picture.save(content, format="JPEG", quality=JPEG_QUALITY, optimize=True)
            packed, way = content.getvalue(), "/DCTDecode"
        else:
            packed, way = zlib.compress(stream.get_data(), 3), "/FlateDecode"
        stream.set_data(packed)
        stream[NameObject("/Filter")] = NameObject(way)
    content = io.BytesIO()
    PdfWriter(clone_from=reader).write(content)
    return content.getvalue()
