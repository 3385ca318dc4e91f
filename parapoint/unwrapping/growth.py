"""Growth of a seam to where its map is most distorted, as long as that pays."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csgraph

from parapoint.surfaces.cutting import cut_along, edge_graph, edge_lengths, origin, path_to
from parapoint.surfaces.surface import BoolArray, FloatArray
from parapoint.unwrapping.descent import LEAST_ENERGY, Run
from parapoint.unwrapping.domains import signed_areas
from parapoint.unwrapping.quality import MOST_STARVED, STARVED

TRIAL_STEPS = 5
"""Steps of SLIM after which a longer seam is judged."""
TRIALS = 3
"""The seam is as long as it should be once so many trials in a row do not pay."""
TRIALS_TO_BOUND = 12
"""As TRIALS, on the way to a bound."""
MOST_BRANCHES = 10
"""The seam grows by so many branches at most where each must pay."""
STEPS_BETWEEN = 10
"""Steps of SLIM between two growths on the way to a bound."""
LEAST_FALL = 0.995
"""The way to a bound ends once steps and branches leave more than this share of the energy."""
MOST_TO_BOUND = 40
"""The seam grows by so many branches at most on the way to a bound of the energy."""


def grow(run: Run, price: float) -> None:
    """Lead the seam to where the map is most distorted (X. Gu et al. 2002), while that pays.

    Args:
        run: the map, which is changed.
        price: what the energy must fall by for each sqrt(area) of seam.
    """
    _grow(run, price, lambda _: False, MOST_BRANCHES)


def grow_to(run: Run, energy: float) -> None:
    """Lead the seam to where the map is most distorted until the energy is at most `energy`.

    It may not get there: a branch that brings nothing is not kept.
    """
    _reach(run, lambda run: run.energy <= energy)


def grow_to_feed(run: Run) -> None:
    """Lead the seam on until no more than MOST_STARVED of the surface is starved of area.

    It may not get there, as `grow_to`.
    """
    _reach(run, lambda run: starved(run) <= MOST_STARVED)


def starved(run: Run) -> float:
    """Share of the surface whose area ratio is below STARVED, that of the whole map being 1."""
    area = run.mesh.face_areas / run.mesh.face_areas.sum()
    uv_area = signed_areas(run.uv, run.mesh.faces)
    return float(area[uv_area / uv_area.sum() < STARVED * area].sum())


def _reach(run: Run, is_enough: Callable[[Run], bool]) -> None:
    """Steps and branches by turns until it is enough, or neither brings anything."""
    energy = np.inf
    while not (is_enough(run) or run.is_late) and run.energy < LEAST_FALL * energy:
        energy = run.energy
        run.improve(STEPS_BETWEEN)
        _grow(run, 0.0, is_enough, MOST_TO_BOUND)


def _grow(run: Run, price: float, is_enough: Callable[[Run], bool], most: int) -> None:
    failed, branches = 0, 0
    trials = TRIALS if price > 0 else TRIALS_TO_BOUND
    blocked: BoolArray = np.zeros(len(run.mesh.vertices), dtype=bool)
    while failed < trials and branches < most and not (run.is_late or is_enough(run)):
        lengths = edge_lengths(run.mesh)
        graph = edge_graph(run.mesh, lengths)
        distance, previous, _ = csgraph.dijkstra(
            graph,
            indices=np.concatenate(run.mesh.boundary_loops),
            return_predecessors=True,
            min_only=True,
        )
        tip = int(np.where(blocked, -1.0, _excess(run) * distance).argmax())
        if blocked[tip] or distance[tip] == 0:
            return
        path = np.array(path_to(previous, tip))
        before, energy = (run.mesh, run.uv), run.energy
        after = cut_along(run.mesh, np.stack([path[:-1], path[1:]], axis=1))
        run.set(after, run.uv[origin(run.mesh, after)])
        uv = run.one_to_one(TRIAL_STEPS)
        if uv is None and price == 0:  # one step at a time needs fewer vertices held
            run.improve(TRIAL_STEPS)
            uv = run.uv
            run.energy = energy
        least = price * float(distance[tip]) / run.unit
        if uv is not None and run.energy - run.energy_of(uv) > least:
            run.uv, run.energy = uv, run.energy_of(uv)
            run.branches += 1
            branches += 1
            failed, blocked = 0, np.zeros(len(run.mesh.vertices), dtype=bool)
        else:
            run.set(*before)
            failed += 1
            around = csgraph.dijkstra(graph, indices=tip, limit=float(distance[tip]) / 2)
            blocked |= np.isfinite(around)


def _excess(run: Run) -> FloatArray:
    """(V,) mean energy above the least of the faces around each vertex, by area."""
    weight = np.repeat(run.mesh.face_areas, 3)
    rows = run.mesh.faces.reshape(-1)
    excess = np.repeat(run.densities(run.uv) - LEAST_ENERGY, 3)
    return np.asarray(np.bincount(rows, weight * excess) / np.bincount(rows, weight))
