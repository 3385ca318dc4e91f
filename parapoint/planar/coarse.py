"""Where the seam of a large mesh should grow, told by a simplified one.

Where a map is distorted depends on the whole shape, and a few faces suffice to show that. Only the
ends of the branches are taken over: on the large mesh they are joined to the seam along its own
edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import igl
import numpy as np

from parapoint.planar.descent import Run
from parapoint.planar.domains import FlatteningError
from parapoint.planar.growth import Need, grown
from parapoint.surfaces.cutting import (
    cut_along,
    edge_graph,
    edge_lengths,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.surface import IntArray, Mesh, flat_faces

COARSE = 4_000
"""Faces of the simplified mesh."""
LARGE = 8_000
"""Faces from which on a mesh is simplified: below, its own growth takes a few seconds."""


@dataclass(frozen=True, eq=False)
class Led:
    """A large mesh, its seam led on as that of its simplified one.

    Attributes:
        domain: the large mesh, cut to where the seam of the simplified one grew.
        tips: the vertices to which its branches lead, in order.
        run: the map of the simplified mesh.
    """

    domain: Mesh
    tips: tuple[int, ...]
    run: Run


def led(mesh: Mesh, need: Need, deadline: float) -> Led | None:
    """The large mesh cut to where the seam of the simplified one grew.

    None where the simplified mesh has no map.

    Args:
        mesh: a planar domain.
        need: what the seam is to bring.
        deadline: no step begins after this time of `clock.worked`.
    """
    simple = simplified(mesh, COARSE)
    if simple is None:
        return None
    coarse, vertex = simple
    run = Run(coarse, deadline)
    try:
        run.begin()
    except FlatteningError:
        return None
    run.improve()
    run = grown(run, need)
    tips = vertex[list(run.tips)].tolist()
    return Led(joined(mesh, tips), tuple(tips), run)


def simplified(mesh: Mesh, count: int) -> tuple[Mesh, IntArray] | None:
    """A mesh of `count` faces, and the vertex of the given mesh that each of its vertices is.

    None where the simplified mesh is another kind of surface, or has faces without area.

    Args:
        mesh: connected, manifold and oriented.
        count: faces, fewer than the mesh has.
    """
    _, faces, _, vertex = igl.qslim(
        np.asfortranarray(mesh.vertices), np.asfortranarray(mesh.faces.astype(np.int32)), count
    )
    coarse = Mesh(mesh.vertices[vertex], faces)
    is_alike = (
        coarse.is_connected_surface
        and coarse.genus == mesh.genus
        and len(coarse.boundary_loops) == len(mesh.boundary_loops)
    )
    if not is_alike or flat_faces(coarse.vertices, coarse.faces).any():
        return None
    return coarse, vertex


def joined(mesh: Mesh, tips: list[int]) -> Mesh:
    """The domain cut along the shortest paths of edges from its boundary to each tip in turn."""
    for tip in tips:
        graph = edge_graph(mesh, edge_lengths(mesh))
        _, previous = ways_to(graph, np.concatenate(mesh.boundary_loops))
        mesh = cut_along(mesh, path_edges(path_to(previous, tip)))
    return mesh
