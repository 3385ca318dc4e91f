"""Several components: each mapped by itself, the maps packed without a change of scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, compact


def by_component(mesh: Mesh, mapped: Callable[[Mesh], Parameterization]) -> Parameterization:
    """The map of a mesh whose components are each `mapped` by themselves, in shelves.

    Args:
        mesh: any mesh.
        mapped: gives the map of a connected mesh without unreferenced vertices.
    """
    label = mesh.face_components
    corners: IntArray = np.empty_like(mesh.faces)
    maps: list[FloatArray] = []
    count = 0
    for component in range(mesh.component_count):
        of = np.flatnonzero(label == component)
        part = mapped(compact(mesh.vertices, mesh.faces[of]))
        corners[of] = part.corners + count
        maps.append(part.uv)
        count += len(part.uv)
    low = np.array([uv.min(axis=0) for uv in maps])
    sizes = np.array([np.ptp(uv, axis=0) for uv in maps])
    placed = [uv + at for uv, at in zip(maps, shelves(sizes) - low, strict=True)]
    return Parameterization(np.concatenate(placed), corners)
