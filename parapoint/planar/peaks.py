"""The parts of a planar domain that stand out from its seam, such as spikes, horns and fingers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from parapoint.surfaces.surface import FloatArray, Mesh


def peaks(
    mesh: Mesh,
    graph: sparse.csr_matrix,
    distance: FloatArray,
    excess: FloatArray,
    least: Callable[[float], float],
) -> dict[int, float]:
    """The farthest vertex of each part that stands out, and what the part holds.

    Parts are the components of what lies farther from the seam than a level that sinks to zero
    (the merge tree of the distance). Where two meet, the one whose peak is lower ends: as a part
    of its own if it holds enough for a branch up to its peak; else the other takes what it holds.

    Args:
        mesh: the domain.
        graph: (V, V) its edges.
        distance: (V,) each vertex's from the seam.
        excess: (F,) what each face holds; it counts for the farthest of its corners.
        least: gives, for the length of a branch, what a part must hold more than.
    """
    rows = np.arange(len(mesh.faces))
    farthest = mesh.faces[rows, distance[mesh.faces].argmax(axis=1)]
    held = np.bincount(farthest, excess, len(distance)).tolist()
    above: dict[int, int] = {}
    holds: dict[int, float] = {}
    found: dict[int, float] = {}

    def peak_of(vertex: int) -> int:
        while above[vertex] != vertex:
            above[vertex] = vertex = above[above[vertex]]
        return vertex

    order = np.argsort(-distance, kind="stable")
    for vertex in order[distance[order] > 0].tolist():
        near = graph.indices[graph.indptr[vertex] : graph.indptr[vertex + 1]].tolist()
        parts = sorted({peak_of(other) for other in near if other in above})
        peak = max(parts, key=distance.__getitem__, default=vertex)
        above[vertex] = peak
        holds[peak] = holds.get(peak, 0.0) + held[vertex]
        for lower in parts:
            if lower == peak:
                continue
            above[lower] = peak
            part = holds.pop(lower)
            if part > least(float(distance[lower] - distance[vertex])):
                found[lower] = part
            else:
                holds[peak] += part
    return found | holds
