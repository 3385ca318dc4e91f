"""The value of every metric for one map."""

from __future__ import annotations

from benchmarks.metrics import pointwise
from benchmarks.metrics.metric import WITHOUT_SPANNING
from benchmarks.metrics.state import MapState
from benchmarks.metrics.table import METRICS
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud


def evaluate(
    mesh: Mesh, parameterization: Parameterization, reference: Parameterization | None = None
) -> dict[str, float]:
    """Every metric of a map of a mesh, by name; never nan.

    Args:
        mesh: the surface, as it was before any cut: seams are where the map leaves its edges.
        parameterization: the map, its faces in the order of the mesh.
        reference: another map of the same faces, which covers all that the map covers; without it
            the group "reference" is left out.

    Raises:
        InputError: a map has another number of faces than the mesh, or the reference leaves out
            faces that the map covers.
    """
    return values(MapState(mesh, parameterization, reference))


def values(state: MapState) -> dict[str, float]:
    """Every metric of the map in `state`, by name; those of a reference only if it has one."""
    found: dict[str, float] = {}
    for name, metric in METRICS.items():
        if metric.group == "points" or (metric.group == "reference" and state.reference is None):
            continue
        everywhere = name.removesuffix(WITHOUT_SPANNING)
        same = everywhere in found and state.distortion_without_spanning is state.distortion
        found[name] = found[everywhere] if same else metric.function(state)
    return found


def evaluate_points(cloud: PointCloud, parameterization: PointParameterization) -> dict[str, float]:
    """Every metric of the group "points", and `coverage`, by name; never nan.

    Raises:
        InputError: the numbers of points differ, or there are fewer than four.
    """
    state = pointwise.point_map(cloud, parameterization)
    of_points = [metric for metric in METRICS.values() if metric.group == "points"]
    return {m.name: m.function(state) for m in (*of_points, METRICS["coverage"])}
