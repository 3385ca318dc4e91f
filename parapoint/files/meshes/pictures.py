"""Pictures and flat colours: what materials show, and the files that others name."""

from __future__ import annotations

import io
import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError

MOST_TEXELS = 16_384
"""Texels along a side of a picture that is read."""
WHITE = (255, 255, 255)

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Material:
    """What a material shows.

    Attributes:
        colour: where it has no picture, 8-bit sRGB.
        picture: the picture of its colour, (H, W, 3 or 4), first row at the top, or None.
    """

    colour: tuple[int, int, int] = WHITE
    picture: Picture | None = None


def read_picture(data: bytes | Path) -> Picture:
    """(H, W, 3 or 4) the pixels of an image file of any kind that Pillow reads.

    Raises:
        InputError: it is none, or is larger than MOST_TEXELS.
    """
    from PIL import Image

    name = f"{data}: " if isinstance(data, Path) else ""
    try:
        with Image.open(data if isinstance(data, Path) else io.BytesIO(data)) as image:
            if max(image.size) > MOST_TEXELS:
                raise InputError(f"{name}a picture of {image.size} texels is too large to bake")
            has_alpha = "A" in image.getbands() or "transparency" in image.info
            return np.asarray(image.convert("RGBA" if has_alpha else "RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{name}is no picture that can be read ({error})") from None


def named_file(folder: Path, written: str) -> Path | None:
    """The file that another one in `folder` names; None where there is none.

    It is looked for as it is written and as a bare name, with any kind of slashes, in upper and
    lower case, and in `folder` itself at last; then by its name in Latin-1.
    """
    latin = written.encode(errors="surrogateescape").decode("latin-1")
    with suppress(OSError):  # a name that is too long, a folder that may not be read
        for name in (written.strip(), bare_name(written), latin.strip(), bare_name(latin)):
            path = Path(folder, name.replace("\\", "/"))
            for place in (path, folder / path.name):
                found = _in_any_case(place)
                if found.is_file():
                    return found
    return None


def bare_name(written: str) -> str:
    """A name without the comment behind it and the quotation marks around it."""
    name = re.sub(r"\s+#.*", "", written).strip()
    return name[1:-1] if re.fullmatch(r"\"[^\"]*\"|'[^']*'", name) else name


def _in_any_case(path: Path) -> Path:
    """The path, with the names of the folders where it differs from one of theirs in case alone."""
    at = Path(path.anchor)
    for part in path.relative_to(at).parts:
        ahead = at / part
        if not ahead.exists() and at.is_dir():
            same = [one for one in at.iterdir() if one.name.casefold() == part.casefold()]
            ahead = same[0] if len(same) == 1 else ahead
        at = ahead
    return at
