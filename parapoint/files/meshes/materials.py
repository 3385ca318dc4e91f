"""Wavefront material libraries: where an OBJ file names them, and the materials they hold."""

from __future__ import annotations

import logging
import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from parapoint.errors import InputError
from parapoint.files.decoding import plain
from parapoint.files.meshes.obj import obj_lines
from parapoint.files.meshes.pictures import (
    WHITE,
    Material,
    Picture,
    Wrap,
    bare_name,
    named_file,
    read_picture,
    readable,
)
from parapoint.surfaces.surface import IntArray

LIBRARY = re.compile(r'"([^"]+)"|(\S.*?\.mtl)(?=\s|$)|(\S.*)', re.IGNORECASE)
"""One of several libraries on a line: in quotation marks, or up to its ending."""
OF_PICTURE = re.compile(r"^\s*(map_\w+|bump|disp|decal|norm|refl)\b", re.IGNORECASE)
"""The word that begins a line of a material library which names a picture."""
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
OPTION = re.compile(
    rf"-(?:(?:mm|[ost])(?:\s+{NUMBER}){{1,3}}|(?:blendu|blendv|bm|boost|cc|clamp|imfchan|texres|type)"
    r"\s+\S+)\s+"
)
"""An option of a picture in a material library (Wavefront's specification)."""

logger = logging.getLogger("parapoint")


def libraries(source: Path) -> tuple[list[Path], bool]:
    """The material libraries that an OBJ file names, and whether one of them names a picture."""
    found: list[Path] = []
    for line in obj_lines(plain(source.read_bytes())):
        words = line.split(None, 1)
        if len(words) == 2 and words[0] == b"mtllib":
            found += named_libraries(source.parent, words[1])
    found = list(dict.fromkeys(found))
    return found, any(OF_PICTURE.match(line) for path in found for line in library_lines(path))


def named_libraries(folder: Path, words: bytes) -> list[Path]:
    """The libraries that stand behind "mtllib", one or several, whether they are there or not."""
    written = words.decode(errors="surrogateescape").strip()
    whole = named_file(folder, written)
    if whole is not None:
        return [whole]
    names = ["".join(found.groups("")) for found in LIBRARY.finditer(bare_name(written))]
    return [named_file(folder, name) or folder / name.replace("\\", "/") for name in names]


def library_lines(library: Path, *, tells: bool = False) -> list[str]:
    """The lines of a material library; none of one that cannot be read, and a warning if asked."""
    fault = "is not found"
    try:
        if library.is_file():
            lines = obj_lines(plain(library.read_bytes()))
            return [line.decode(errors="surrogateescape") for line in lines]
    except InputError as error:
        fault = str(error)
    except OSError as error:
        fault = f"cannot be read: {error.strerror or error}"
    if tells:
        name = readable(str(library))
        logger.warning("%s: its materials are not known: it %s", name, fault)
    return []


def materials_of(libraries: list[Path]) -> dict[str, Material]:
    """The materials in Wavefront material libraries, by name, as it is written and readable.

    Libraries and pictures that are missing are left out with a warning; a material without its
    picture shows its colour.

    Raises:
        InputError: a picture is none, or is too large.
    """
    found: dict[str, Material] = {}
    for library in libraries:
        name, missing = "", []
        files: dict[str, dict[str, Path]] = {}  # by material and word, the picture
        for line in library_lines(library, tells=True):
            word, rest = [*line.strip().split(None, 1), "", ""][:2]
            kind = word.lower()
            if kind == "newmtl":
                name = rest
                found[name], files[name] = Material(), {}
            elif kind == "kd" and name:
                found[name] = replace(found[name], colour=_eight_bits(rest))
            elif kind in {"map_kd", "map_d"} and name and rest:
                picture, options = _picture_and_options(rest)
                path = named_file(library.parent, picture)
                if path is None:
                    missing.append(picture)
                    continue
                files[name][kind] = path
                if kind == "map_kd" or "map_kd" not in files[name]:
                    found[name] = _placed(found[name].colour, options)
        for name, of in files.items():
            found[name] = replace(found[name], picture=_picture(found[name].colour, of))
        if missing:
            logger.warning(
                "%s: pictures that are not found are left out: %s",
                library,
                ", ".join(map(readable, dict.fromkeys(missing))),
            )
    return {readable(bare_name(name)): of for name, of in found.items()} | found


def _picture(colour: tuple[int, int, int], files: dict[str, Path]) -> Picture | None:
    """What a material shows of its picture (map_kd), as far as another (map_d) lets it be seen.

    One picture that is both has an alpha for that. Of another one, that is the alpha, or else the
    grey.
    """
    from PIL import Image

    shown, mask = files.get("map_kd"), files.get("map_d")
    picture = None if shown is None else read_picture(shown)
    if mask is None or mask == shown:
        return picture
    given = read_picture(mask)
    own = given[..., 3] if given.shape[2] == 4 and (given[..., 3] < 255).any() else given[..., 0]
    if picture is None:
        picture = np.full((*own.shape, 3), colour, np.uint8)
    height, width = picture.shape[:2]
    alpha = np.asarray(Image.fromarray(own).resize((width, height)))
    return np.dstack([picture[..., :3], alpha])


def _picture_and_options(words: str) -> tuple[str, list[list[str]]]:
    """The picture that a line names, and the words of each option before it."""
    options = []
    while (option := OPTION.match(words)) is not None:
        options.append(option[0].split())
        words = words[option.end() :]
    return words, options


def _placed(colour: tuple[int, int, int], options: list[list[str]]) -> Material:
    """A material whose picture will lie where the options -s, -o and -clamp of its line say."""
    material = Material(colour)
    for kind, *words in options:
        if kind == "-clamp":
            on: Wrap = "clamp" if words[0].lower() == "on" else "repeat"
            material = replace(material, wraps=(on, on))
        elif kind == "-s":
            u, v = [*map(float, words), 1.0][:2]
            material = replace(material, scale=(u, v))
        elif kind == "-o":
            u, v = [*map(float, words), 0.0][:2]
            material = replace(material, offset=(u, v))
    return material


def library_pictures(library: Path) -> list[Path]:
    """The pictures that a material library names and that are there, of whatever kind."""
    lines = [
        line.strip().split(None, 1) for line in library_lines(library) if OF_PICTURE.match(line)
    ]
    named = [
        named_file(library.parent, _picture_and_options(line[1])[0]) for line in lines if line[1:]
    ]
    return [path for path in named if path is not None]


def _eight_bits(words: str) -> tuple[int, int, int]:
    """The colour of three words from 0 to 1, or of one for all; white where they are none."""
    try:
        parts = [
            round(255 * min(max(float(word), 0), 1)) for word in words.replace(",", ".").split()[:3]
        ]
        red, green, blue = 3 * parts if len(parts) == 1 else parts
    except ValueError:
        return WHITE
    return red, green, blue


def material_names(data: bytes) -> tuple[list[str], IntArray]:
    """The names that usemtl lines of an OBJ file give, and (N,) the one of each polygon.

    Name 0 is "", of polygons before the first such line.
    """
    names, of = [""], []
    number: dict[str, int] = {"": 0}
    current = 0
    for line in obj_lines(plain(data)):
        words = line.split(None, 1)
        if len(words) == 2 and words[0] in {b"f", b"fo"}:
            if not words[1].startswith(b"#"):
                of.append(current)
        elif len(words) == 2 and words[0] == b"usemtl":
            name = words[1].strip().decode(errors="surrogateescape")
            current = number.setdefault(name, len(names))
            if current == len(names):
                names.append(name)
    return names, np.array(of, dtype=np.int64)
