"""Where a triangulated cloud is cut open, told by the scale of its conformal map.

A linear solve tells that scale without the map (`parapoint.computed.scale`). The cuts lead from the
boundary to where it is most extreme (as in Sawhney and Crane 2017, "Boundary first flattening",
section 6), and are as long as an even scale needs. Where every part of the surface is to keep its
area they lead on to what the map would starve.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.sparse import csgraph

from parapoint.computed.parts import MOST_STARVED, Distortion
from parapoint.computed.scale import area_discrepancy, even_scale, log_scale, mapped_areas, turning
from parapoint.planar.embedding import embeddable, few_edges_graph, path_edges
from parapoint.surfaces.areas import STARVED
from parapoint.surfaces.cutting import cut_along, cut_to_disk
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh

AREA_DISCREPANCY = 0.6
"""Cuts are added until the predicted total area discrepancy, of 2, is this small."""
OPEN_SEAM, CLOSED_SEAM = 0.022, 0.037
"""Most edges of the cuts for an even scale, as a fraction of the faces, on surfaces with and
without boundary."""
TIPS = 3
"""Extremal points that are tried as the tip of each cut."""
PREDICTED_STARVED = MOST_STARVED / 2
"""Share of the surface that the predicted scale may starve; the map's own is up to 0.5 % above."""
FED = 0.35
"""Cuts are led to what has less than this part of its fair area, and are judged by it: above
STARVED, so that a part is not just lifted over that bound."""
TRIALS = 6
"""Times that no cut helps before what is starved is given up."""


class Branch(NamedTuple):
    """A cut from the boundary of a mesh to a tip.

    Attributes:
        cut: the mesh after it.
        gain: what it brings for each of its edges.
    """

    cut: Mesh
    gain: float


def seamed(mesh: Mesh, distortion: Distortion = "conformal") -> Mesh:
    """The mesh cut to a planar domain whose flat map has the scale that is asked for.

    Args:
        mesh: connected, manifold, oriented.
        distortion: "conformal" cuts for an even scale alone, the others feed every part, too.
    """
    share = OPEN_SEAM if mesh.boundary_loops else CLOSED_SEAM
    budget = int(share * len(mesh.faces))
    opened = mesh
    if mesh.genus > 0 or not mesh.boundary_loops:
        opened = cut_to_disk(mesh)
    opened = joined_loops(opened)
    opened = evened(opened, budget - (len(opened.vertices) - len(mesh.vertices)))
    if distortion != "conformal":
        opened = fed(opened)
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
        distance, previous, _ = csgraph.dijkstra(
            few_edges_graph(mesh), indices=loops[worst], return_predecessors=True, min_only=True
        )
        others = np.concatenate([loop for i, loop in enumerate(loops) if i != worst])
        mesh = cut_along(mesh, path_edges(previous, int(others[distance[others].argmin()])))
    return mesh


def evened(mesh: Mesh, budget: int) -> Mesh:
    """The planar domain cut to where the scale is most extreme, until it is even enough.

    Extreme is what is far from the boundary and in its log scale from the mean area's.

    Args:
        mesh: the domain.
        budget: edges of all these cuts at most.
    """

    def discrepancy(of: Mesh) -> float:
        return area_discrepancy(of, log_scale(of))

    area = mesh.face_areas.sum()
    while discrepancy(mesh) > AREA_DISCREPANCY:
        scale = log_scale(mesh)
        extreme = np.abs(scale - np.log(mapped_areas(mesh, scale).sum() / area) / 2)
        branch, _ = _best_branch(mesh, extreme, discrepancy, budget)
        if branch is None or branch.gain <= 0:
            break
        budget -= len(branch.cut.vertices) - len(mesh.vertices)
        mesh = branch.cut
    return mesh


def fed(mesh: Mesh) -> Mesh:
    """The planar domain cut to what its flat map would starve of area, until that is little."""
    failed = 0
    given_up: BoolArray = np.zeros(len(mesh.vertices), dtype=bool)
    while failed < TRIALS and _predicted_starved(mesh) > PREDICTED_STARVED:
        lacks = np.zeros(len(mesh.vertices))
        np.maximum.at(lacks, mesh.faces.reshape(-1), np.repeat(_lacks(mesh), 3))
        branch, tried = _best_branch(mesh, np.where(given_up, 0.0, lacks), _mean_lack)
        if branch is None:
            break
        if branch.gain > 0:
            mesh, failed = branch.cut, 0
            given_up = np.zeros(len(mesh.vertices), dtype=bool)
        else:
            given_up, failed = given_up | tried, failed + 1
    return mesh


def _best_branch(
    mesh: Mesh, wanted: FloatArray, fault: Callable[[Mesh], float], budget: float = np.inf
) -> tuple[Branch | None, BoolArray]:
    """The cut that gains most for each edge, and (V,) what lies around the tips that were tried.

    Args:
        mesh: a planar domain.
        wanted: (V,) times the distance from the boundary: where the tips are sought.
        fault: what a gain is the fall of.
        budget: edges of the cut at most.
    """
    graph = few_edges_graph(mesh)
    distance, previous, _ = csgraph.dijkstra(
        graph,
        indices=np.concatenate(mesh.boundary_loops),
        return_predecessors=True,
        min_only=True,
    )
    before, best = fault(mesh), None
    tried: BoolArray = np.zeros(len(wanted), dtype=bool)
    for _ in range(TIPS):
        want = np.where(tried, 0.0, wanted * distance)
        tip = int(want.argmax())
        if want[tip] == 0:
            break
        tried |= np.isfinite(csgraph.dijkstra(graph, indices=tip, limit=distance[tip] / 2))
        path = path_edges(previous, tip)
        if len(path) <= budget:
            cut = cut_along(mesh, path)
            branch = Branch(cut, (before - fault(cut)) / len(path))
            best = branch if best is None or branch.gain > best.gain else best
    return best, tried


def _predicted_ratios(mesh: Mesh) -> FloatArray:
    """(F,) each face's share of the flat map's area over its share of the surface, predicted."""
    is_disk = len(mesh.boundary_loops) == 1
    mapped = mapped_areas(mesh, even_scale(mesh) if is_disk else log_scale(mesh))
    return np.asarray(mapped / mapped.sum() * mesh.face_areas.sum() / mesh.face_areas)


def _predicted_starved(mesh: Mesh) -> float:
    """The share of the surface that the flat map will starve."""
    area = mesh.face_areas
    return float(area[_predicted_ratios(mesh) < STARVED].sum() / area.sum())


def _lacks(mesh: Mesh) -> FloatArray:
    """(F,) how far each face is below FED of its fair area, as a logarithm; 0 where it is not."""
    return np.asarray(np.log(FED / np.clip(_predicted_ratios(mesh), 1e-12, FED)))


def _mean_lack(mesh: Mesh) -> float:
    """The mean of `_lacks` over the area."""
    return float(_lacks(mesh) @ mesh.face_areas / mesh.face_areas.sum())
