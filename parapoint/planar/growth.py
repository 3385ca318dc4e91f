"""Growth of a seam to where its map is most distorted (X. Gu et al. 2002, "Geometry images")."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csgraph

from parapoint.planar.descent import LEAST_ENERGY, Run
from parapoint.planar.peaks import peaks
from parapoint.surfaces.areas import LEAST_PART, starved_faces, starved_share
from parapoint.surfaces.cutting import (
    cut_along,
    edge_graph,
    edge_lengths,
    path_edges,
    path_to,
    ways_to,
)
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

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

    def toll(self, run: Run, branches: int = 1) -> Callable[[float], float]:
        """What the energy must fall by for branches of any length in all, in the mesh's unit."""
        enough = branches * LEAST_FALL * (run.energy - LEAST_ENERGY) if self.of(run) else np.inf
        return lambda length: min(self.price * length / run.unit, enough)


def grown(run: Run, need: Need) -> Run:
    """The map after its seam was led on to where it is most distorted.

    A branch stays where it pays, or where more seam is needed and it brings anything. Branches are
    sought on a free map, where one that fails costs a few steps; a map along them that is one to
    one is then begun anew, and stays if they pay together. Where no single one pays, as on an
    urchin with many spikes, branches to all parts that stand out are tried at once. Where branches
    bring the energy below its bound, the last is made as short as that allows. Where more seam is
    needed still, branches of the map that is one to one open one by one, in many more steps.

    Args:
        run: the map, settled; it is left as it is.
        need: what the seam is to bring.
    """
    while need.may_grow(run) and not run.is_late:
        longer = _paid(run, _led_on(run.freed(), need), need)
        longer = longer or _paid(run, _branched(run, need), need)
        if longer is None:
            break
        run = longer
    return _led_on(run, need) if need.of(run) else run


def _paid(run: Run, branched: Run, need: Need) -> Run | None:
    """A map along the branches that a run was given, one to one; None where they do not pay."""
    branches, added = branched.branches - run.branches, (branched.rim - run.rim) / 2
    longer = branched.held(run.deadline) if branches else None
    if longer is None or not run.energy - longer.energy > need.toll(run, branches)(added):
        return None
    shorter = _shortened(branched, need)
    if shorter is not branched and (held := shorter.held(run.deadline)) and not need.of(held):
        return held
    return longer


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
    distance, previous = ways_to(graph, np.concatenate(run.mesh.boundary_loops))
    excess = _excess(run)
    worth = _mean_around(run.mesh, excess) * distance
    if need.is_starved(run):
        worth *= _corners(run.mesh, starved_faces(run.mesh, run.uv))
    toll = need.toll(run)
    for _ in range(TRIALS_IN_NEED if need.of(run) else TRIALS):
        while True:
            tip = int(worth.argmax())
            if worth[tip] <= 0 or run.is_late:
                return None
            least = toll(float(distance[tip]))
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


def _branched(run: Run, need: Need) -> Run:
    """The run cut to the parts that stand out and could pay together, its map not yet begun.

    A branch to one of many spikes hardly changes the energy of all, and pays for the way there
    alone. Together they share that way: the next branch leads to where most is left of what a part
    can bring, less its length from the seam and the branches so far, and the best sum ends them.
    It is the same run where fewer than two are found, as single ones are tried in `_longer`.
    """
    graph = edge_graph(run.mesh, edge_lengths(run.mesh))
    seam = np.concatenate(run.mesh.boundary_loops)
    toll = need.toll(run)
    distance, previous = ways_to(graph, seam)
    prizes = peaks(run.mesh, graph, distance, _excess(run), toll)
    tips: list[int] = []
    paths: list[IntArray] = []
    sums: list[float] = []
    while prizes := {tip: prize for tip, prize in prizes.items() if distance[tip] > 0}:
        gains = {tip: prize - toll(float(distance[tip])) for tip, prize in prizes.items()}
        tip = max(gains, key=gains.__getitem__)
        path = path_to(previous, tip)
        tips.append(tip)
        paths.append(path_edges(path))
        sums.append(gains[tip])
        seam = np.union1d(seam, path)
        distance, previous = ways_to(graph, seam)
    count = int(np.argmax(np.cumsum([0.0, *sums])))
    if count < 2:
        return run
    longer = Run(cut_along(run.mesh, np.concatenate(paths[:count])), run.deadline)
    longer.tips = (*run.tips, *tips[:count])
    return longer


def _excess(run: Run) -> FloatArray:
    """(F,) what each face adds to the energy above its least."""
    area = run.mesh.face_areas
    return np.asarray(area / area.sum() * (run.densities() - LEAST_ENERGY))


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
