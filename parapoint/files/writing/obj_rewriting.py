"""An OBJ file written anew with other UVs, all else as it was."""

from __future__ import annotations

import logging
import os
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.files.decoding import plain
from parapoint.files.meshes.materials import OF_PICTURE, library_lines, named_libraries
from parapoint.files.meshes.obj import obj_lines
from parapoint.files.polygons import corner_rows
from parapoint.files.targets import beside, complete_file, sealed_text
from parapoint.files.writing.mesh_writers import write_picture
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray

logger = logging.getLogger("parapoint")


def write_library(out: Path, texture: npt.NDArray[Any] | None, given: list[Path]) -> str:
    """Write the materials of libraries beside an OBJ file, with one texture of all their colours.

    The texture stands for all pictures of colours (map_Kd), and for what they let through (map_d)
    if it has an alpha. Other pictures, which were drawn for other UVs, are left out, and a warning
    names their kinds; without a texture so are all.

    Returns:
        The line of the OBJ file that names the new library.
    """
    library = beside(out, ".mtl")
    image = "" if texture is None else write_picture(out, texture).name
    held = {"map_kd": "map_Kd"}
    if texture is not None and texture.shape[2] == 4:
        held["map_d"] = "map_d"
    kept, left = [], set()
    for line in (line for path in given for line in library_lines(path)):
        word = OF_PICTURE.match(line)
        if word is None:
            kept.append(line)
        elif image and word[1].lower() in held:
            kept.append(f"{held[word[1].lower()]} {image}")
        else:
            left.add(word[1])
    if left:
        logger.warning(
            "%s: pictures that were drawn for the old UVs are left out: %s",
            library,
            ", ".join(sorted(left)),
        )
    with complete_file(library) as file:
        file.write(sealed_text("".join(f"{line}\n" for line in kept)))
    return f"mtllib {library.name}\n"


def rewrite_obj(
    source: Path,
    out: Path,
    parameterization: Parameterization,
    places: IntArray,
    *,
    material: str | None = None,
    keeps_libraries: bool,
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
    row, is_split = corner_rows(places, parameterization.corners)
    triangles_of: dict[int, list[int]] = {}
    for triangle, place in enumerate(places.min(axis=1).tolist()):
        triangles_of.setdefault(place, []).append(triangle)
    starts = np.array(sorted(triangles_of))
    made: list[bytes] = [] if material is None else [material.encode(errors="surrogateescape")]
    uv_lines = "".join(f"vt {u!r} {v!r}\n" for u, v in parameterization.uv.tolist()).encode()
    place = split = 0
    began = False
    for line in obj_lines(plain(source.read_bytes())):
        words = line.split(b"#", 1)[0].split()
        kind = words[0] if words else b""
        if kind == b"vt":
            continue
        if kind == b"mtllib":
            if keeps_libraries:
                made += _from_folder(line, source, out)
        elif kind == b"l":
            made.append(b" ".join([kind, *(word.split(b"/")[0] for word in words[1:])]) + b"\n")
        elif kind in {b"f", b"fo"}:
            if len(words) == 1:
                continue
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


def _from_folder(line: bytes, source: Path, out: Path) -> list[bytes]:
    """Lines that name the libraries of a mtllib line as seen from the folder of `out`."""
    found = named_libraries(source.parent.resolve(), line.split(None, 1)[1])
    paths = (os.path.relpath(path, out.parent.resolve()) for path in found)
    return [b"mtllib " + path.encode(errors="surrogateescape") + b"\n" for path in paths]
