"""Growth of a seam to where its map is most distorted (X. Gu et al. 2002, "Geometry images")."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csgraph

from parapoint.planar.descent import LEAST_ENERGY, Run
from parapoint.surfaces.areas import MOST_STARVED, starved_faces, starved_share
from parapoint.surfaces.cutting import edge_graph, edge_lengths, path_to
from parapoint.surfaces.surface import BoolArray, FloatArray

PRICE = 1.0
"""What the symmetric Dirichlet energy (4 at least) must fall by for each sqrt(area) of seam, unless
told otherwise."""
TRIALS, TRIALS_IN_NEED = 3, 6
"""The seam stops growing once branches to this many places in a row do not pay; the second number
holds where more seam is needed at any price."""
MOST_BRANCHES = 40
"""The seam grows by at most this many branches."""
LEAST_FALL = 0.01
"""Share of the energy's excess that a branch must take away where more seam is needed at any
price."""


def grown(
    run: Run,
    price: float,
    *,
    most_starved: float = MOST_STARVED,
    most_energy: float = np.inf,
) -> Run:
    """The map after its seam was led on to where it is most distorted.

    A branch stays where it pays, or where more seam is needed and it brings anything.

    Args:
        run: the map, settled; it is left as it is.
        price: what the energy must fall by for each sqrt(area) of seam.
        most_starved: share of the surface that may be starved of area; above it more seam is
            needed.
        most_energy: above this energy more seam is needed.
    """
    failed, branches = 0, 0
    blocked: BoolArray = np.zeros(len(run.mesh.vertices), dtype=bool)
    while failed < TRIALS_IN_NEED and branches < MOST_BRANCHES and not run.is_late:
        graph = edge_graph(run.mesh, edge_lengths(run.mesh))
        distance, previous, _ = csgraph.dijkstra(
            graph,
            indices=np.concatenate(run.mesh.boundary_loops),
            return_predecessors=True,
            min_only=True,
        )
        is_starved = starved_share(run.mesh, run.uv) > most_starved
        is_needed = is_starved or run.energy > most_energy
        if failed >= TRIALS and not is_needed:
            break
        need = np.where(blocked, 0.0, _excess(run) * distance)
        if is_starved:
            need *= _around(run, starved_faces(run.mesh, run.uv))
        tip = int(need.argmax())
        if need[tip] == 0:
            break
        least = price * float(distance[tip]) / run.unit
        if is_needed:
            least = min(least, LEAST_FALL * (run.energy - LEAST_ENERGY))
        near = csgraph.dijkstra(graph, indices=tip, limit=float(distance[tip]))
        longer = None
        if _excess_within(run, np.isfinite(near)) > least:
            longer = run.cut(np.array(path_to(previous, tip)))
        if longer is not None and run.energy - longer.energy > least:
            run = longer
            failed, branches = 0, branches + 1
            blocked = np.zeros(len(run.mesh.vertices), dtype=bool)
        else:
            failed += longer is not None
            blocked |= near < float(distance[tip]) / 2
    return run


def _around(run: Run, faces: BoolArray) -> BoolArray:
    """(V,) the corners of some faces (F,)."""
    corners: BoolArray = np.zeros(len(run.mesh.vertices), dtype=bool)
    corners[run.mesh.faces[faces]] = True
    return corners


def _excess(run: Run) -> FloatArray:
    """(V,) mean energy above the least of the faces around each vertex, by area."""
    weight = np.repeat(run.mesh.face_areas, 3)
    rows = run.mesh.faces.reshape(-1)
    excess = np.repeat(run.densities() - LEAST_ENERGY, 3)
    return np.asarray(np.bincount(rows, weight * excess) / np.bincount(rows, weight))


def _excess_within(run: Run, vertices: BoolArray) -> float:
    """What faces at some vertices (V,) add to the energy's excess: all that a branch could gain."""
    area = run.mesh.face_areas
    inside = vertices[run.mesh.faces].any(axis=1)
    return float(area[inside] @ (run.densities()[inside] - LEAST_ENERGY) / area.sum())
