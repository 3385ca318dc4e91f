"""A PLY file written anew with other UVs, all else as it was."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from plyfile import PlyData, PlyElement, PlyListProperty

from parapoint.files.decoding import plain
from parapoint.files.ply import INDICES, UV_COLUMNS
from parapoint.files.polygons import corner_rows
from parapoint.files.targets import complete_file
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray

PICTURE = "TextureFile "
"""How the comment begins that names a picture, as MeshLab writes it."""
FACE_UV = {"texcoord", "texnumber"}
"""Properties of faces that go with the old UVs."""


Lists = list[npt.NDArray[Any]]


def pictures_of(path: Path) -> tuple[list[str], IntArray]:
    """The pictures that a PLY file names, and (N,) the number of the one on each polygon."""
    file = _read(path)
    names = [one.removeprefix(PICTURE).strip() for one in file.comments if one.startswith(PICTURE)]
    faces = file["face"].data
    if "texnumber" in faces.dtype.names:
        return names, faces["texnumber"].astype(np.int64)
    return names, np.zeros(len(faces), dtype=np.int64)


def has_strips(path: Path) -> bool:
    """Whether a PLY file holds triangle strips, not faces."""
    return b"element face" not in plain(path.read_bytes()).partition(b"end_header")[0]


def rewrite_ply(
    source: Path,
    out: Path,
    parameterization: Parameterization,
    places: IntArray,
    *,
    picture: str | None = None,
) -> int:
    """Copy a PLY file with new UVs: s and t at the vertices, and "texcoord" at the faces.

    Vertices and faces keep their order and all that is known of them. Behind the vertices stand
    copies of those on the seam, one for each further uv. A polygon stays one unless the seam runs
    through it: then it becomes its triangles.

    Args:
        source: the PLY file that was read.
        out: the PLY file that is written; it appears only when it is complete.
        parameterization: a map of the mesh's triangles, in the order of the file.
        places: (F, 3) for each corner of the triangles, its place among the polygons' corners.
        picture: name of the picture beside it, or None.

    Returns:
        The number of polygons that became triangles.
    """
    file = _read(source)
    faces = file["face"].data
    name = next(name for name in faces.dtype.names if name in INDICES)
    sizes = np.array([len(one) for one in faces[name]], dtype=np.int64)
    corners = np.concatenate(list(faces[name])).astype(np.int64)
    row, is_split = corner_rows(places, parameterization.corners)
    polygon = np.searchsorted(np.cumsum(sizes), places[:, 0], side="right")
    broken = np.zeros(len(sizes), dtype=bool)
    broken[polygon[is_split]] = True

    # Runs of corners, one after the other: whole polygons, and the triangles of broken ones.
    corner_polygon = np.repeat(np.arange(len(sizes)), sizes)
    whole = np.flatnonzero(~broken[corner_polygon])
    cut = np.flatnonzero(broken[polygon])
    vertex = np.concatenate([corners[whole], corners[places[cut]].reshape(-1)])
    uv_row = np.concatenate([row[whole], parameterization.corners[cut].reshape(-1)])
    of = np.concatenate([np.flatnonzero(~broken), polygon[cut]])
    length = np.concatenate([sizes[~broken], np.full(len(cut), 3)])

    table = file["vertex"].data
    index, first = _copies(vertex, uv_row, len(table))
    uv = np.zeros((len(first), 2))
    uv[index] = parameterization.uv[uv_row]
    runs = np.cumsum(length)[:-1]
    lists: dict[str, Lists] = {
        name: np.split(index.astype(np.int32), runs),
        "texcoord": np.split(uv[index].astype(np.float32).reshape(-1), 2 * runs),
    }
    made = {"vertex": _vertices(file["vertex"], uv, first), "face": _faces(file["face"], lists, of)}
    written = PlyData(
        [made.get(one.name, one) for one in file.elements],
        text=file.text,
        byte_order=file.byte_order,
        comments=[
            *([PICTURE + picture] if picture else []),
            *(one for one in file.comments if not one.startswith(PICTURE)),
        ],
        obj_info=file.obj_info,
    )
    data = io.BytesIO()
    written.write(data)
    with complete_file(out) as target:
        target.write(data.getvalue())
    return int(broken.sum())


def _copies(vertex: IntArray, row: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The new vertex of each corner, and the old one of each new vertex.

    A vertex keeps its number for the first of its uv rows; others get numbers from `count` on.
    """
    pairs, pair = np.unique(np.stack([vertex, row], axis=1), axis=0, return_inverse=True)
    again = np.zeros(len(pairs), dtype=bool)
    again[1:] = pairs[1:, 0] == pairs[:-1, 0]
    number = np.where(again, count + np.cumsum(again) - 1, pairs[:, 0])
    return number[pair.reshape(-1)], np.concatenate([np.arange(count), pairs[again, 0]])


def _vertices(element: PlyElement, uv: npt.NDArray[np.float64], first: IntArray) -> PlyElement:
    """The vertices (V,) and the copies of some, in this order, with their UVs."""
    names = element.data.dtype.names
    old = next((set(pair) for pair in UV_COLUMNS if set(pair) <= set(names)), set())
    kept = [name for name in names if name not in old]
    types = [(name, element.data.dtype[name]) for name in kept]
    table = np.empty(len(first), dtype=[*types, ("s", "f8"), ("t", "f8")])
    for name in kept:
        table[name] = element.data[name][first]
    table["s"], table["t"] = uv.T
    return PlyElement.describe(table, "vertex", comments=element.comments)


def _faces(element: PlyElement, lists: dict[str, Lists], of: IntArray) -> PlyElement:
    """Polygons with these lists, each with all else that is known of the one it was part of."""
    lists = {
        name: [values[k] for k in np.argsort(of, kind="stable")] for name, values in lists.items()
    }
    of = np.sort(of)
    names = [name for name in element.data.dtype.names if name not in {*FACE_UV, *lists}]
    types = [(name, element.data.dtype[name]) for name in names]
    table = np.empty(len(of), dtype=[*types, *((name, object) for name in lists)])
    for name in names:
        table[name] = element.data[name][of]
    for name, values in lists.items():
        column = np.empty(len(of), dtype=object)
        column[:] = values
        table[name] = column
    given = [one for one in element.properties if isinstance(one, PlyListProperty)]
    counts = {one.name: one.len_dtype for one in given if one.name in names} | dict.fromkeys(
        lists, "u1"
    )
    kinds = {one.name: one.val_dtype for one in given if one.name in names}
    kinds |= {name: values[0].dtype.str[1:] for name, values in lists.items()}
    return PlyElement.describe(table, "face", counts, kinds, comments=element.comments)


def _read(path: Path) -> PlyData:
    return PlyData.read(io.BytesIO(plain(path.read_bytes())))
