"""Several components: each mapped by itself, the maps packed without a change of scale."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from parapoint.parameterization import Parameterization
from parapoint.surface import FloatArray, IntArray, Mesh

GAP = 0.01
"""Space between two maps on a page, in widths of the page."""


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
        used, faces = np.unique(mesh.faces[of], return_inverse=True)
        part = mapped(Mesh(mesh.vertices[used], faces.reshape(-1, 3)))
        corners[of] = part.corners + count
        maps.append(part.uv)
        count += len(part.uv)
    return Parameterization(np.concatenate(on_shelves(maps)), corners)


def on_shelves(maps: list[FloatArray]) -> list[FloatArray]:
    """The maps (T, 2) moved onto shelves of a page that is about square, the tallest ones first."""
    boxes = np.array([np.ptp(uv, axis=0) for uv in maps])
    width = max(float(np.sqrt(boxes.prod(axis=1).sum())), float(boxes[:, 0].max()))
    gap = GAP * width
    placed = list(maps)
    x = y = shelf = 0.0
    for row in np.argsort(-boxes[:, 1], kind="stable").tolist():
        if x > 0 and x + boxes[row, 0] > width:
            x, y, shelf = 0.0, y + shelf + gap, 0.0
        placed[row] = maps[row] - maps[row].min(axis=0) + [x, y]
        x += boxes[row, 0] + gap
        shelf = max(shelf, float(boxes[row, 1]))
    return placed
