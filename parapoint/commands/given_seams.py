"""The edges along which `unwrap --seams FILE` cuts a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.files.reading import UV_FORMATS, read_parameterized
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import IntArray, Mesh


def read_seams(path: str, mesh: Mesh) -> IntArray:
    """(S, 2) the edges that a text file lists, or the seams of the UV map in a mesh file.

    A line of a text has the numbers of two vertices, counted from 1 as OBJ does. Of several
    vertices at one place, either end may be any.

    Raises:
        InputError: the file cannot be read, or names what is no edge of the mesh.
    """
    known = {frozenset(edge) for edge in mesh.welded.edges.tolist()}
    if Path(path).suffix.lower() in UV_FORMATS:
        seams = _seams_of_map(path, mesh)
        for edge in seams.tolist():
            if frozenset(edge) not in known:
                at = mesh.vertices[edge[0]].tolist()
                raise InputError(f"{path}: has a seam near {at} that is no edge of the mesh")
        return seams
    found = []
    for number, line in enumerate(Path(path).read_text(errors="replace").splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            one, other = (int(word) - 1 for word in words)
        except ValueError:
            raise InputError(f"{path}: line {number} is not two vertex numbers") from None
        ends = [one, other]
        is_vertex = min(ends) >= 0 and max(ends) < len(mesh.place)
        if not is_vertex or frozenset(mesh.place[ends].tolist()) not in known:
            raise InputError(f"{path}: line {number} is no edge of the mesh")
        found.append(ends)
    if not found:
        raise InputError(f"{path}: has no edge")
    return np.array(found, dtype=np.int64)


def _seams_of_map(path: str, mesh: Mesh) -> IntArray:
    """(S, 2) the vertices of the mesh that are nearest to the ends of each seam of another map."""
    mapped, map_ = Charted(*read_parameterized(path)).welded()
    ends = mapped.vertices[map_.seams(mapped)]
    return np.asarray(mesh.place[cKDTree(mesh.vertices).query(ends)[1]])
