"""Wavefront material libraries: where an OBJ file names them, and the materials they hold."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np

from parapoint.errors import InputError
from parapoint.files.decoding import plain
from parapoint.files.meshes.obj import obj_lines
from parapoint.files.meshes.pictures import WHITE, Material, bare_name, named_file, read_picture
from parapoint.surfaces.surface import IntArray

LIBRARY = re.compile(r'"([^"]+)"|(\S.*?\.mtl)(?=\s|$)|(\S.*)', re.IGNORECASE)
"""One of several libraries on a line: in quotation marks, or up to its ending."""
OF_PICTURE = re.compile(r"^\s*(map_\w+|bump|disp|decal|norm|refl)\b", re.IGNORECASE)
"""The word that begins a line of a material library which names a picture."""
OPTION = re.compile(
    r"-(?:(?:mm|[ost])(?:\s+[-+.\deE]+)+|(?:blendu|blendv|bm|boost|cc|clamp|imfchan|texres|type)"
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
        logger.warning("%s: its materials are not known: it %s", library, fault)
    return []


def materials_of(libraries: list[Path]) -> dict[str, Material]:
    """The materials in Wavefront material libraries, by name.

    Libraries and pictures that are missing are left out with a warning; a material without its
    picture shows its colour.

    Raises:
        InputError: a picture is none, or is too large.
    """
    found: dict[str, Material] = {}
    for library in libraries:
        name, missing = "", []
        for line in library_lines(library, tells=True):
            kind, rest = [*line.strip().split(None, 1), "", ""][:2]
            if kind.lower() == "newmtl":
                name = rest
                found[name] = Material()
            elif kind.lower() == "kd" and name:
                found[name] = Material(_eight_bits(rest), found[name].picture)
            elif kind.lower() == "map_kd" and name and rest:
                rest = _without_options(rest)
                path = named_file(library.parent, rest)
                if path is None:
                    missing.append(rest)
                else:
                    found[name] = Material(found[name].colour, read_picture(path))
        if missing:
            logger.warning(
                "%s: pictures that are not found are left out: %s",
                library,
                ", ".join(dict.fromkeys(missing)),
            )
    return {bare_name(name): of for name, of in found.items()} | found


def library_pictures(library: Path) -> list[Path]:
    """The pictures that a material library names and that are there, of whatever kind."""
    lines = [
        line.strip().split(None, 1) for line in library_lines(library) if OF_PICTURE.match(line)
    ]
    named = [named_file(library.parent, _without_options(line[1])) for line in lines if line[1:]]
    return [path for path in named if path is not None]


def _without_options(words: str) -> str:
    """The name of a picture, without the options before it."""
    while (option := OPTION.match(words)) is not None:
        words = words[option.end() :]
    return words


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
