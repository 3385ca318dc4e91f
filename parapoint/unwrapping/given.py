"""Maps along seams that are given."""

from __future__ import annotations

import math

from parapoint.errors import InputError
from parapoint.planar.descent import Run
from parapoint.planar.domains import check_triangles
from parapoint.surfaces.cutting import cut_along, cut_to_disk
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray, Mesh
from parapoint.unwrapping.packing import by_component


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
