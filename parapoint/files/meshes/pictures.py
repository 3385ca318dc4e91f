"""Pictures and flat colours: what materials show, and the files that others name."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal
from unicodedata import normalize

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError

if TYPE_CHECKING:
    from PIL.Image import Image

MOST_TEXELS = 16_384
"""Texels along a side of a picture that is read."""
WHITE = (255, 255, 255)
ONLY_16_BITS = {("I", "PNG"), ("I", "PPM")}
"""Modes of Pillow and formats that together mean numbers from 0 to 65535."""

Picture = npt.NDArray[np.uint8]
Wrap = Literal["repeat", "mirror", "clamp"]
"""Beyond its edge a picture begins anew, or runs back, or its last texel goes on."""


@dataclass(frozen=True)
class Material:
    """What a material shows.

    Attributes:
        colour: where it has no picture, 8-bit sRGB.
        picture: the picture of its colour, (H, W, 3 or 4), first row at the top, or None.
        scale, offset: a UV of the file is multiplied by one, and the other is added, where it
            reads the picture.
        wraps: how the picture goes on beyond its edges, along u and along v.
    """

    colour: tuple[int, int, int] = WHITE
    picture: Picture | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    wraps: tuple[Wrap, Wrap] = ("repeat", "repeat")


def read_picture(data: bytes | Path, name: str = "") -> Picture:
    """(H, W, 3 or 4) the pixels of an image file of any kind that Pillow reads.

    Grey of 16 bits becomes grey of 8.

    Args:
        data: the file, or its bytes.
        name: what messages call it; a file is called by its path.

    Raises:
        InputError: it is none, is larger than MOST_TEXELS, or holds numbers of no known range.
    """
    from PIL import Image as Images
    from PIL import UnidentifiedImageError

    try:
        with (
            _unbounded(),
            Images.open(data if isinstance(data, Path) else io.BytesIO(data)) as image,
        ):
            return _pixels(image)
    except InputError as error:
        fault = str(error)
    except UnidentifiedImageError:
        fault = "is no picture of a kind that is read; save it as PNG or JPEG"
    except (OSError, ValueError, SyntaxError) as error:
        fault = f"is no picture that can be read ({error})"
    name = str(data) if isinstance(data, Path) else name
    raise InputError(f"{name}: {fault}" if name else fault)


@contextmanager
def _unbounded() -> Iterator[None]:
    """Leave the bound of a picture's size to us: inside, Pillow has none."""
    from PIL import Image as Images

    bound = Images.MAX_IMAGE_PIXELS
    Images.MAX_IMAGE_PIXELS = None
    try:
        yield
    finally:
        Images.MAX_IMAGE_PIXELS = bound


def _pixels(image: Image) -> Picture:
    """(H, W, 3 or 4) the pixels of an image that is open.

    Raises:
        InputError: it is larger than MOST_TEXELS, or its numbers have no known range.
    """
    if max(image.size) > MOST_TEXELS:
        width, height = image.size
        raise InputError(
            f"is a picture of {width:,} by {height:,} texels; at most {MOST_TEXELS:,} along a side "
            "are read: make it smaller"
        )
    if not image.mode.startswith(("I", "F")):
        has_alpha = "A" in image.getbands() or "transparency" in image.info
        return np.asarray(image.convert("RGBA" if has_alpha else "RGB"))
    # Pillow clips numbers of more than 8 bits. It opens those of 16 as "I;16" in some byte order,
    # or as "I" where the format has no wider ones.
    if not image.mode.startswith("I;16") and (image.mode, image.format) not in ONLY_16_BITS:
        raise InputError("is a picture of numbers of no known range; save it with 8 or 16 bits")
    values = np.asarray(image).astype(np.int64)
    shown = np.repeat(values[..., None] * 255 / 65535, 3, axis=2)
    if (hidden := image.info.get("transparency")) is not None:
        shown = np.dstack([shown, np.where(values == hidden, 0, 255)])
    return np.rint(shown).astype(np.uint8)


def named_file(folder: Path, written: str) -> Path | None:
    """The file that another one in `folder` names; None where there is none.

    It is looked for as it is written and as a bare name, with any kind of slashes, in upper and
    lower case, and in `folder` itself at last. Bytes of the name that are no UTF-8, as surrogates,
    may also be Windows-1252 or Latin-1.
    """
    latin = written.encode(errors="surrogateescape").decode("latin-1")
    names = [written.strip(), bare_name(written), latin.strip(), bare_name(latin)]
    with suppress(OSError):  # a name that is too long, a folder that may not be read
        for name in dict.fromkeys(names + [readable(name) for name in names]):
            path = Path(folder, name.replace("\\", "/"))
            for place in (path, folder / path.name):
                found = _in_any_case(place)
                if found.is_file():
                    return found
    return None


def readable(name: str) -> str:
    """A name as it can be printed: bytes that are no UTF-8, as surrogates, are Windows-1252."""
    data = name.encode(errors="surrogateescape")
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def bare_name(written: str) -> str:
    """A name without the comment behind it and the quotation marks around it."""
    name = re.sub(r"\s+#.*", "", written).strip()
    return name[1:-1] if re.fullmatch(r"\"[^\"]*\"|'[^']*'", name) else name


def _in_any_case(path: Path) -> Path:
    """The path, with the names of the folders where it differs from one of theirs in case alone.

    An accent may be a character of its own, as on macOS.
    """
    at = Path(path.anchor)
    for part in path.relative_to(at).parts:
        ahead = at / part
        if not ahead.exists() and at.is_dir():
            same = [one for one in at.iterdir() if _alike(one.name) == _alike(part)]
            ahead = same[0] if len(same) == 1 else ahead
        at = ahead
    return at


def _alike(name: str) -> str:
    """What names have in common that people take for one."""
    return normalize("NFC", name).casefold()
