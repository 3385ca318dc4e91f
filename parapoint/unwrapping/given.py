"""Maps along seams that are given."""

from __future__ import annotations

import math

import numpy as np

from parapoint.errors import InputError
from parapoint.planar.descent import Run
from parapoint.planar.domains import check_triangles
from parapoint.surfaces.cutting import cut_along, cut_to_disk, edge_lengths, edge_mask
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import Preparation, prepared
from parapoint.surfaces.surface import BoolArray, IntArray, Mesh, flat_faces
from parapoint.unwrapping.packing import by_component


def mended_along(mesh: Mesh, seams: IntArray, deadline: float = math.inf) -> Parameterization:
    """The map of any mesh along its seams: welded and mended first, as `Unwrap` does it.

    Args:
        mesh: what is unwrapped.
        seams: (S, 2) vertices; the mesh is cut wherever an edge joins their places.
        deadline: see `unwrapped_along`.

    Raises:
        UnsupportedError: no face has an area.
        FlatteningError: a chart has no start without flips.
    """
    whole = mesh.welded
    preparation = prepared(whole, frozenset({"manifold", "oriented"}))
    (part,) = preparation.parts
    assert isinstance(part, Mesh)
    cut = _beside_flat_faces(whole, edge_mask(whole, mesh.place[seams]))
    made = unwrapped_along(part, _carried(whole, cut, preparation, part), deadline)
    joined = preparation.joined([made])
    assert isinstance(joined, Parameterization)
    report = {**made.report, "steps": preparation.steps}
    return Parameterization(joined.uv, joined.corners, report=report)


def _beside_flat_faces(mesh: Mesh, cut: BoolArray) -> BoolArray:
    """(E,) the edges that are cut, and the short ones of faces without area whose long one is."""
    sides = mesh.edge_of_halfedge.reshape(-1, 3)[flat_faces(mesh.vertices, mesh.faces)]
    longest = sides[np.arange(len(sides)), edge_lengths(mesh)[sides].argmax(axis=1)]
    while True:
        wider = cut.copy()
        wider[sides[cut[longest]]] = True
        if (wider == cut).all():
            return cut
        cut = wider


def _carried(whole: Mesh, cut: BoolArray, preparation: Preparation, part: Mesh) -> IntArray:
    """(S, 2) the edges of the part that a whole mesh became, at those that are cut in this."""
    if preparation.origin is None:
        return whole.edges[cut]
    corner = np.flatnonzero(cut[whole.edge_of_halfedge])
    following = corner - corner % 3 + (corner + 1) % 3
    vertex = part.faces.reshape(-1)[preparation.origin.reshape(-1)]
    return part.edges[edge_mask(part, np.stack([vertex[corner], vertex[following]], axis=1))]


def unwrapped_along(mesh: Mesh, seams: IntArray, deadline: float = math.inf) -> Parameterization:
    """An isometric map of each chart that a mesh falls into along its seams, one to one.

    Charts that are no disks, with or without holes, are cut to disks automatically (the report
    counts them); all are packed without a change of scale.

    Args:
        mesh: manifold and consistently oriented.
        seams: (S, 2) edges along which the mesh is cut.
        deadline: `clock.worked()` after which no step begins.

    Raises:
        InputError: the mesh is not so, or a triangle has no area.
        FlatteningError: a chart has no start without flips.
    """
    if not (mesh.is_manifold and mesh.is_oriented):
        raise InputError("seams can be given for a manifold, consistently oriented mesh alone")
    completed = 0
    parts: list[dict[str, object]] = []

    def mapped(chart: Mesh) -> Parameterization:
        nonlocal completed
        check_triangles(chart.vertices, chart.faces)
        if not chart.is_planar_domain:
            chart, completed = cut_to_disk(chart), completed + 1
        run = Run(chart, deadline)
        run.begin()
        run.improve()
        parts.append(run.report())
        return Parameterization(run.uv, chart.faces)

    result = by_component(cut_along(mesh, seams), mapped)
    report = {"charts_cut_to_disks": completed, "parts": parts}
    return Parameterization(result.uv, result.corners, report=report)
