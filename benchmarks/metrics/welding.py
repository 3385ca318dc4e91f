"""What a map is scored on: the faces that it covers, with vertices at one place counted as one.

Writers of OBJ, PLY and glTF double the vertices along a seam, or give each corner a vertex of its
own. The same map must score the same in every file. So vertices at one place are welded, and rows
of uv that agree there become one row. Faces without a uv are left out, and the share of the
surface that is left says so.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


class Scored(NamedTuple):
    """A map as it is scored.

    Attributes:
        mesh: the faces that the map covers, in the order of the whole mesh.
        parameterization: their map.
        reference: another map of the same faces, or None.
        coverage: the share of the 3D area, from 0 to 1, that the map covers; the share of the
            number of faces if none has an area.
        welded: the number of vertices that were welded to another one.
    """

    mesh: Mesh
    parameterization: Parameterization
    reference: Parameterization | None
    coverage: float
    welded: int


def scored(
    mesh: Mesh, parameterization: Parameterization, reference: Parameterization | None = None
) -> Scored:
    """The faces that a map covers, with their vertices welded.

    Raises:
        InputError: the map covers no face.
    """
    covered = parameterization.covered
    coverage = 1.0
    if not covered.all():
        areas = mesh.face_areas
        shares = areas if areas.sum() > 0 else np.ones(len(areas))
        coverage = float(shares[covered].sum() / shares.sum())
        if not covered.any():
            raise InputError("the map covers no face: every uv is NaN")
        mesh = Mesh(mesh.vertices, mesh.faces[covered])
        parameterization = Parameterization(parameterization.uv, parameterization.corners[covered])
        if reference is not None:
            reference = Parameterization(reference.uv, reference.corners[covered])
    first, place = np.unique(mesh.place, return_inverse=True)
    doubled = len(place) - len(first)
    if not doubled:
        return Scored(mesh, parameterization, reference, coverage, 0)
    faces = place[mesh.faces]
    return Scored(
        Mesh(mesh.vertices[first], faces),
        parameterization.shared_at(faces),
        None if reference is None else reference.shared_at(faces),
        coverage,
        doubled,
    )
