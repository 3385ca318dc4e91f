"""Where a triangulated cloud is cut open, told by the scale of its conformal map.

A linear solve tells that scale without the map (`parapoint.computed.scale`). The cuts lead from the
boundary to where it is most extreme (as in Sawhney and Crane 2017, "Boundary first flattening",
section 6), and are as long as an even scale needs. Where every part of the surface is to keep its
area they lead on to what the map would starve.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import csgraph

from parapoint import clock
from parapoint.computed.parts import Distortion
from parapoint.computed.scale import area_discrepancy, even_scale, log_scale, mapped_areas, turning
from parapoint.planar.embedding import embeddable, few_edges_graph
from parapoint.surfaces.areas import LEAST_PART, STARVED
from parapoint.surfaces.cutting import cut_along, cut_to_disk, path_edges, path_to, ways_to
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

AREA_DISCREPANCY = 0.6
"""Cuts are added until the predicted total area discrepancy, of 2, is this small."""
OPEN_SEAM, CLOSED_SEAM = 0.022, 0.037
"""Most edges of the cuts for an even scale, as a fraction of the faces, on surfaces with and
without boundary."""
TIPS = 3
"""Extremal points that are tried as the tip of each cut."""
PREDICTED_STARVED = LEAST_PART / 2
"""Share of the surface that the predicted scale may starve; the map's own is up to 0.5 % above."""
FED = 0.35
"""Cuts are led to what has less than this part of its fair area, and are judged by it: above
STARVED, so that a part is not just lifted over that bound."""
LEAST_GAIN = 0.1
"""A cut helps if it takes away at least this share of the fault for each sqrt(faces) of its edges,
which lead about once across the surface: 116 of 120 cuts on thirteen models that help at all do."""
TRIALS = 6
"""Times that no cut helps before what is starved is given up."""


class Prediction(NamedTuple):
    """What the scale of a planar domain's flat map tells.

    Attributes:
        mesh: the domain.
        wanted: (V,) how much a cut is wanted to each vertex, for each unit of its distance from the
            boundary.
        fault: what cuts are to bring down.
        is_good: whether they have.
    """

    mesh: Mesh
    wanted: FloatArray
    fault: float
    is_good: bool


def seamed(mesh: Mesh, distortion: Distortion = "conformal", deadline: float = math.inf) -> Mesh:
    """The mesh cut to a planar domain whose flat map has the scale that is asked for.

    Args:
        mesh: connected, manifold, oriented.
        distortion: all are cut for an even scale; "balanced" is cut on to what a conformal map
            starves, and so keeps both angles and parts.
        deadline: no part is fed after this time of `clock.worked`.
    """
    share = OPEN_SEAM if mesh.boundary_loops else CLOSED_SEAM
    budget = int(share * len(mesh.faces))
    opened = mesh
    if mesh.genus > 0 or not mesh.boundary_loops:
        opened = cut_to_disk(mesh)
    opened = joined_loops(opened)
    opened = evened(opened, budget - (len(opened.vertices) - len(mesh.vertices)))
    if distortion == "balanced":
        opened = fed(opened, deadline)
    return embeddable(opened)


def joined_loops(mesh: Mesh) -> Mesh:
    """The planar domain cut between the boundary loops that a flat planar map cannot have.

    In the flat metric an inner loop turns by −2π; one that turns otherwise, such as the end of a
    tube, is joined to the nearest other loop.
    """
    while len(loops := mesh.boundary_loops) > 1:
        turns = turning(mesh, log_scale(mesh, flat_loops=False))
        wrong = np.abs(turns + 2 * np.pi)
        wrong[turns.argmax()] = 0
        worst = int(wrong.argmax())
        if wrong[worst] < np.pi:
            break
        distance, previous = ways_to(few_edges_graph(mesh), loops[worst])
        others = np.concatenate([loop for i, loop in enumerate(loops) if i != worst])
        nearest = int(others[distance[others].argmin()])
        mesh = cut_along(mesh, path_edges(path_to(previous, nearest)))
    return mesh


def evened(mesh: Mesh, budget: int) -> Mesh:
    """The planar domain cut to where its scale is most extreme, by at most `budget` edges."""
    return _led(mesh, _evenness, trials=1, budget=budget)


def fed(mesh: Mesh, deadline: float = math.inf) -> Mesh:
    """The planar domain cut to what its flat map would starve of area, as far as that helps.

    A domain with holes is fed as a disk, unless half as many edges do with its holes left: no cut
    from the mouth of a vase that stands on a floor widens the neck by which it hangs on the floor.
    Nor is the prediction as good around a hole, where the flat metric need not close up.
    """
    if len(mesh.boundary_loops) == 1 or _starvation(mesh).is_good:
        return _led(mesh, _starvation, trials=TRIALS, deadline=deadline)
    disk = _led(cut_to_disk(mesh), _starvation, trials=TRIALS, deadline=deadline)
    half = (len(disk.vertices) - len(mesh.vertices)) / 2
    holed = _led(mesh, _starvation, trials=TRIALS, budget=half, deadline=deadline)
    return holed if _starvation(holed).is_good else disk


def _led(
    mesh: Mesh,
    predict: Callable[[Mesh], Prediction],
    *,
    trials: int,
    budget: float = math.inf,
    deadline: float = math.inf,
) -> Mesh:
    """The domain after cuts to where they are wanted, until it is good or no cut helps.

    Of some tips the one whose cut gains most for each edge is taken.

    Args:
        mesh: a planar domain.
        predict: what is wanted where.
        trials: times in a row that no cut may help before the rest is given up.
        budget: edges of all cuts at most.
        deadline: no cut is sought after this time of `clock.worked`.
    """
    now, failed = predict(mesh), 0
    given_up: BoolArray = np.zeros(len(mesh.vertices), dtype=bool)
    while failed < trials and not now.is_good and clock.worked() < deadline:
        tips, around = _branches(now, given_up)
        longer = [
            (predict(cut_along(now.mesh, path)), len(path)) for path in tips if len(path) <= budget
        ]
        gains = [(now.fault - cut.fault) / length for cut, length in longer]
        if not gains:
            break
        best = int(np.argmax(gains))
        if gains[best] > LEAST_GAIN * now.fault / len(mesh.faces) ** 0.5:
            now, length = longer[best]
            budget, failed = budget - length, 0
            given_up = np.zeros(len(now.mesh.vertices), dtype=bool)
        else:
            given_up, failed = around, failed + 1
    return now.mesh


def _branches(now: Prediction, given_up: BoolArray) -> tuple[list[IntArray], BoolArray]:
    """Edges (n, 2) of paths from the boundary to at most TIPS tips, and (V,) what is near those.

    Tips are where the wish for a cut, times the distance, is greatest; none is near another, nor
    among what was given up (V,), which is returned with the rest.
    """
    graph = few_edges_graph(now.mesh)
    distance, previous = ways_to(graph, np.concatenate(now.mesh.boundary_loops))
    paths = []
    for _ in range(TIPS):
        want = np.where(given_up, 0.0, now.wanted * distance)
        tip = int(want.argmax())
        if want[tip] == 0:
            break
        paths.append(path_edges(path_to(previous, tip)))
        near = csgraph.dijkstra(graph, indices=tip, limit=distance[tip] / 2)
        given_up = given_up | np.isfinite(near)
    return paths, given_up


def _evenness(mesh: Mesh) -> Prediction:
    """Cuts are wanted where the scale is far from that of the mean area."""
    scale = log_scale(mesh)
    middle = np.log(mapped_areas(mesh, scale).sum() / mesh.face_areas.sum()) / 2
    discrepancy = area_discrepancy(mesh, scale)
    return Prediction(mesh, np.abs(scale - middle), discrepancy, discrepancy <= AREA_DISCREPANCY)


def _starvation(mesh: Mesh) -> Prediction:
    """Cuts are wanted where a face has less than FED of its fair area, by the ratio's logarithm."""
    area = mesh.face_areas / mesh.face_areas.sum()
    ratios = _fair_ratios(mesh)
    lacks = np.log(FED / np.clip(ratios, 1e-12, FED))
    wanted = np.zeros(len(mesh.vertices))
    np.maximum.at(wanted, mesh.faces.reshape(-1), np.repeat(lacks, 3))
    starved = float(area[ratios < STARVED].sum())
    return Prediction(mesh, wanted, float(area @ lacks), starved <= PREDICTED_STARVED)


def _fair_ratios(mesh: Mesh) -> FloatArray:
    """(F,) predicted share of each face in the map's area over its share of the surface."""
    is_disk = len(mesh.boundary_loops) == 1
    mapped = mapped_areas(mesh, even_scale(mesh) if is_disk else log_scale(mesh))
    return np.asarray(mapped / mapped.sum() * mesh.face_areas.sum() / mesh.face_areas)
