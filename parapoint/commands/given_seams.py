"""The edges along which `unwrap --seams FILE` cuts a mesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.files.decoding import plain
from parapoint.files.reading import UV_FORMATS, check_file, faults_of, read_parameterized
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import IntArray, Mesh

FARTHEST = 0.01
"""How far an end of a seam may lie from the mesh, as a share of the mesh's size. Rounding moves it
less; farther off another vertex may be meant, as those of ten thousand faces lie this far apart."""


def read_seams(path: str, mesh: Mesh) -> IntArray:
    """(S, 2) the edges that a text file lists, or the seams of the UV map in a mesh file.

    A line of a text has the numbers of two vertices, counted from 1 as OBJ does. Of several
    vertices at one place, either end may be any.

    Raises:
        InputError: the file cannot be read, or names what is no edge of the mesh.
    """
    with faults_of(Path(path)):
        return _seams_in(Path(path), mesh)


def _seams_in(path: Path, mesh: Mesh) -> IntArray:
    known = {frozenset(edge) for edge in mesh.welded.edges.tolist()}
    if path.suffix.lower() in UV_FORMATS:
        seams = _seams_of_map(path, mesh)
        for edge in seams.tolist():
            if frozenset(edge) not in known:
                at = mesh.vertices[edge[0]].tolist()
                raise InputError(f"has a seam near {at} that is no edge of the mesh")
        return seams
    found = []
    check_file(path)
    text = plain(path.read_bytes()).decode(errors="replace")
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            one, other = (int(word) - 1 for word in words)
        except ValueError:
            raise InputError(f"line {number} is not two vertex numbers") from None
        ends = [one, other]
        is_vertex = min(ends) >= 0 and max(ends) < len(mesh.place)
        if not is_vertex or frozenset(mesh.place[ends].tolist()) not in known:
            hint = "; numbers count from 1" if -1 in ends else ""
            raise InputError(f"line {number} is no edge of the mesh{hint}")
        found.append(ends)
    if not found:
        raise InputError("has no edge")
    return np.array(found, dtype=np.int64)


def _seams_of_map(path: Path, mesh: Mesh) -> IntArray:
    """(S, 2) the vertices of the mesh that are nearest to the ends of each seam of another map.

    Raises:
        InputError: the map cannot be read, or an end lies farther than FARTHEST from the mesh.
    """
    mapped, map_ = Charted(*read_parameterized(path)).welded()
    ends = mapped.vertices[map_.seams(mapped)]
    distance, nearest = cKDTree(mesh.vertices).query(ends)
    size = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.faces].reshape(-1, 3), axis=0)))
    farthest = float(distance.max(initial=0))
    if farthest > FARTHEST * size:
        raise InputError(
            f"has a seam that is {farthest:.3g} off the vertices of the mesh, whose size is "
            f"{size:.3g}; give a map of the same mesh, at the same place and scale"
        )
    return np.asarray(mesh.place[nearest])
