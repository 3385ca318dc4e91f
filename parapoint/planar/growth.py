"""Growth of a seam to where its map is most distorted (X. Gu et al. 2002, "Geometry images")."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph

from parapoint.planar.descent import LEAST_ENERGY, Run
from parapoint.surfaces.areas import LEAST_PART, starved_faces, starved_share
from parapoint.surfaces.cutting import edge_graph, edge_lengths, path_to
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh

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


@dataclass(frozen=True)
class Need:
    """What a seam is to bring.

    Attributes:
        price: what the energy must fall by for each sqrt(area) of seam; infinite where the seam is
            to grow in need alone.
        most_starved: share of the surface that may be starved of area; above it more seam is
            needed.
        most_energy: above this energy more seam is needed.
    """

    price: float = PRICE
    most_starved: float = LEAST_PART
    most_energy: float = np.inf

    def is_starved(self, run: Run) -> bool:
        """Whether too much of the surface is starved of area."""
        return starved_share(run.mesh, run.uv) > self.most_starved

    def of(self, run: Run) -> bool:
        """Whether more seam is needed at any price."""
        return self.is_starved(run) or run.energy > self.most_energy

    def may_grow(self, run: Run) -> bool:
        """Whether any branch could be worth its length."""
        return self.price < np.inf or self.of(run)

    def least(self, run: Run, length: float) -> float:
        """What the energy must fall by for a branch of a length in the unit of the mesh."""
        paid = self.price * length / run.unit
        if self.of(run):
            return min(paid, LEAST_FALL * (run.energy - LEAST_ENERGY))
        return paid


def grown(run: Run, need: Need) -> Run:
    """The map after its seam was led on to where it is most distorted.

    A branch stays where it pays, or where more seam is needed and it brings anything. Branches are
    sought on a free map, where one that fails costs a few steps; a map along them that is one to
    one is then begun anew, and stays if they pay together. Where they bring the energy below its
    bound, the last is made as short as that allows. Where more seam is needed still, branches of
    the map that is one to one open one by one, in many more steps.

    Args:
        run: the map, settled; it is left as it is.
        need: what the seam is to bring.
    """
    while need.may_grow(run) and not run.is_late:
        free = _led_on(run.freed(), need)
        longer = free.held(run.deadline) if free.branches > run.branches else None
        if longer is None:
            break
        added = (free.rim - run.rim) / 2
        if not run.energy - longer.energy > need.least(run, added):
            break
        run = longer
        shorter = _shortened(free, need)
        if shorter is not free and (held := shorter.held(run.deadline)) and not need.of(held):
            run = held
    return _led_on(run, need) if need.of(run) else run


def _led_on(run: Run, need: Need) -> Run:
    """The map after branches were tried one after another, to where it is most distorted."""
    while run.branches < MOST_BRANCHES and need.may_grow(run):
        longer = _longer(run, need)
        if longer is None:
            break
        run = longer
    return run


def _longer(run: Run, need: Need) -> Run | None:
    """The map with one more branch; None where none is found."""
    graph = edge_graph(run.mesh, edge_lengths(run.mesh))
    rim = np.concatenate(run.mesh.boundary_loops)
    distance, previous, _ = csgraph.dijkstra(
        graph, indices=rim, return_predecessors=True, min_only=True
    )
    area = run.mesh.face_areas
    excess = area / area.sum() * (run.densities() - LEAST_ENERGY)
    worth = _mean_around(run.mesh, excess) * distance
    if need.is_starved(run):
        worth *= _corners(run.mesh, starved_faces(run.mesh, run.uv))
    for _ in range(TRIALS_IN_NEED if need.of(run) else TRIALS):
        while True:
            tip = int(worth.argmax())
            if worth[tip] <= 0 or run.is_late:
                return None
            least = need.least(run, float(distance[tip]))
            near = csgraph.dijkstra(graph, indices=tip, limit=float(distance[tip]))
            worth[near < float(distance[tip]) / 2] = 0
            # No branch could gain more than all of the excess around.
            if excess[np.isfinite(near)[run.mesh.faces].any(axis=1)].sum() > least:
                break
        path = np.array(path_to(previous, tip))
        longer = run.cut(path, run.energy - least)
        if longer is not None and run.energy - longer.energy > least:
            longer.grown_from = run, path
            return longer
    return None


def _shortened(run: Run, need: Need) -> Run:
    """The run with as little of its last branch as keeps the energy below its bound."""
    if run.grown_from is None or need.of(run):
        return run
    before, path = run.grown_from
    shortest, too_short, enough = run, 0, len(path) - 1  # edges, from the seam on
    while before.energy > need.most_energy and enough - too_short > 1:
        middle = (too_short + enough) // 2
        shorter = before.cut(path[len(path) - 1 - middle :], need.most_energy)
        if shorter is None or need.of(shorter):
            too_short = middle
        else:
            shortest, enough = shorter, middle
    return shortest


def _corners(mesh: Mesh, faces: BoolArray) -> BoolArray:
    """(V,) the corners of some faces (F,)."""
    corners: BoolArray = np.zeros(len(mesh.vertices), dtype=bool)
    corners[mesh.faces[faces]] = True
    return corners


def _mean_around(mesh: Mesh, shares: FloatArray) -> FloatArray:
    """(V,) what the faces around each vertex hold of a whole's shares (F,), for their area."""
    rows = mesh.faces.reshape(-1)
    held, area = (np.bincount(rows, np.repeat(of, 3)) for of in (shares, mesh.face_areas))
    return np.asarray(held / area)
