"""An OBJ file written anew with other UVs, all else as it was."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from parapoint.files.decoding import plain
from parapoint.files.targets import complete_file
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray

TEXTURED = re.compile(rb"^\s*(map_|bump|disp|decal|norm|refl)", re.MULTILINE | re.IGNORECASE)
"""Lines of a material library that name a picture."""


def libraries(source: Path) -> tuple[list[Path], bool]:
    """The material libraries that an OBJ file names, and whether one of them names a picture."""
    found: list[Path] = []
    for line in _lines(plain(source.read_bytes())):
        words = line.split(None, 1)
        if len(words) == 2 and words[0] == b"mtllib":
            found.append(source.parent / words[1].strip().decode(errors="replace"))
    pictures = any(TEXTURED.search(path.read_bytes()) for path in found if path.is_file())
    return found, pictures


def rewrite_obj(
    source: Path,
    out: Path,
    parameterization: Parameterization,
    places: IntArray,
    *,
    material: str | None = None,
    keeps_libraries: bool = True,
) -> int:
    """Copy an OBJ file line by line, with new vt lines and new vt indices at its faces.

    A polygon stays one unless the seam runs through it: then it becomes its triangles.

    Args:
        source: the OBJ file that was read.
        out: the OBJ file that is written; it appears only when it is complete.
        parameterization: a map of the mesh's triangles, in the order of the file.
        places: (F, 3) for each corner of the triangles, its place among the corners of all f
            lines.
        material: lines to put in front, or None.
        keeps_libraries: whether mtllib lines stay; they are written as seen from `out`.

    Returns:
        The number of polygons that became triangles.
    """
    row = np.full(int(places.max()) + 1, -1, dtype=np.int64)
    row[places] = parameterization.corners
    is_split = (row[places] != parameterization.corners).any(axis=1)
    triangles_of: dict[int, list[int]] = {}
    for triangle, place in enumerate(places.min(axis=1).tolist()):
        triangles_of.setdefault(place, []).append(triangle)
    starts = np.array(sorted(triangles_of))
    made: list[bytes] = [] if material is None else [material.encode()]
    uv_lines = "".join(f"vt {u!r} {v!r}\n" for u, v in parameterization.uv.tolist()).encode()
    place = split = 0
    began = False
    for line in _lines(plain(source.read_bytes())):
        words = line.split(b"#", 1)[0].split()
        kind = words[0] if words else b""
        if kind == b"vt":
            continue
        if kind == b"mtllib":
            if keeps_libraries:
                made.append(_from_folder(line, source, out))
        elif kind == b"l":
            made.append(b" ".join([kind, *(word.split(b"/")[0] for word in words[1:])]) + b"\n")
        elif kind in {b"f", b"fo"}:
            if not began:
                made.append(uv_lines)
                began = True
            corners = words[1:]
            first = np.searchsorted(starts, [place, place + len(corners)])
            inside = [t for start in starts[first[0] : first[1]] for t in triangles_of[start]]
            if is_split[inside].any():
                split += 1
                for t in inside:
                    own = zip(places[t].tolist(), parameterization.corners[t].tolist(), strict=True)
                    made.append(_face([(corners[at - place], vt) for at, vt in own]))
            else:
                rows = row[place : place + len(corners)].tolist()
                made.append(_face(list(zip(corners, rows, strict=True))))
            place += len(corners)
        else:
            made.append(line + b"\n")
    with complete_file(out) as file:
        file.write(b"".join(made))
    return split


def _face(corners: list[tuple[bytes, int]]) -> bytes:
    """An f line of words v, v/vt, v//vn or v/vt/vn, each with the row of its new UV."""
    words = []
    for word, row in corners:
        parts = word.split(b"/")
        normal = parts[2] if len(parts) > 2 else b""
        words.append(b"%s/%d" % (parts[0], row + 1) + (b"/" + normal if normal else b""))
    return b"f " + b" ".join(words) + b"\n"


def _from_folder(line: bytes, source: Path, out: Path) -> bytes:
    """A mtllib line that names the same file as seen from the folder of `out`."""
    name = line.split(None, 1)[1].strip().decode(errors="surrogateescape")
    path = os.path.relpath(source.parent.resolve() / name, out.parent.resolve())
    return b"mtllib " + path.encode(errors="surrogateescape") + b"\n"


def _lines(data: bytes) -> Iterator[bytes]:
    """Lines without their ends; those that go on after a backslash are joined."""
    yield from re.sub(rb"\\\r?\n", b" ", data).splitlines()
