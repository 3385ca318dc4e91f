"""The registry of metrics, and the values of all of them for one map.

METRICS holds every name that a table, a JSON object or `metrics.parquet` may have, with its label,
unit, direction, ideal, weighting, normalization and source; nothing else defines a metric. Each
distortion metric stands twice: over all faces, and `_without_spanning` over the map restricted to
the faces that span no seam (`benchmarks.metrics.seams`), normalized over these alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np

from benchmarks.metrics import distortion, pointwise, seams, usability, validity
from benchmarks.metrics.distortion import FaceDistortion, Triangles, face_distortion, triangles
from benchmarks.metrics.welding import scored
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud

WITHOUT_SPANNING = "_without_spanning"

Group = Literal[
    "conformal", "authalic", "isometric", "validity", "use", "seams", "reference", "points"
]
GROUPS: dict[Group, str] = {
    "conformal": "angles",
    "authalic": "areas",
    "isometric": "lengths",
    "validity": "flipped, degenerate and overlapping faces",
    "use": "the worst part, and what a texture needs",
    "seams": "seams, charts, packing",
    "reference": "against the reference map",
    "points": "point cloud, no mesh",
}
"""Each group of metrics, in the order of the tables, and its title."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A metric: what it is called, how to read it, where it comes from, how it is computed.

    Attributes:
        name: key in results.
        label: short heading of a table column.
        group: which table it belongs to.
        function: its value, from a MapState (group "points": from a PointMap).
        weighting: how faces (corners, points) are weighted.
        source: who defined it so.
        unit: "radians", "faces", ... or "" for a pure number.
        normalization: what the value is relative to; printed with the heading.
        better: which way is better.
        ideal: value of a perfect map, None where there is none that a map can reach.
    """

    name: str
    label: str
    group: Group
    function: Callable[[Any], float]
    weighting: str
    source: str
    unit: str = ""
    normalization: str = ""
    better: Literal["lower", "higher"] = "lower"
    ideal: float | None = 0.0

    @property
    def heading(self) -> str:
        """Label, unit and normalization: nobody has to guess."""
        notes = ", ".join(note for note in (self.unit, self.normalization) if note)
        return f"{self.label} ({notes})" if notes else self.label


@dataclass(frozen=True, eq=False)
class MapState:
    """A map with all that more than one metric needs, each computed once and when asked for.

    Faces that the map leaves out (NaN) are left out here too, and vertices at one place are welded.

    Attributes:
        mesh: the surface.
        parameterization: the map.
        reference: another map of the same faces, or None.
        coverage: share of the surface, from 0 to 1, that the map covers.
        welded: number of vertices that lie where another one does.

    Raises:
        InputError: a map has another number of faces than the mesh.
    """

    mesh: Mesh
    parameterization: Parameterization
    reference: Parameterization | None = None
    coverage: float = field(init=False, default=1.0)
    welded: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        for name, of in (("map", self.parameterization), ("reference", self.reference)):
            if of is not None and len(of.corners) != len(self.mesh.faces):
                raise InputError(
                    f"the {name} has {len(of.corners)} faces, the mesh {len(self.mesh.faces)}; "
                    "both must have the same faces in the same order"
                )
        found = scored(self.mesh, self.parameterization, self.reference)
        for name, value in found._asdict().items():
            object.__setattr__(self, name, value)

    @cached_property
    def triangles(self) -> Triangles:
        """Every face before normalization."""
        return triangles(self.mesh, self.parameterization)

    @cached_property
    def spanning(self) -> BoolArray:
        """(F,) whether a face spans a seam."""
        overlapped = self.validity.overlaps.overlapped
        return seams.spanning_faces(self.mesh, self.parameterization, overlapped)

    @cached_property
    def distortion(self) -> FaceDistortion:
        """Distortion of all faces with 3D area."""
        return face_distortion(self.triangles)

    @cached_property
    def distortion_without_spanning(self) -> FaceDistortion:
        """Distortion of those of them that span no seam."""
        if not self.spanning.any():
            return self.distortion
        return face_distortion(self.triangles, ~self.spanning)

    @cached_property
    def validity_without_spanning(self) -> validity.Validity:
        """State of the validity metrics over the faces that span no seam."""
        return self.validity.of(~self.spanning) if self.spanning.any() else self.validity

    @cached_property
    def validity(self) -> validity.Validity:
        """State of the validity metrics."""
        return validity.Validity(self.parameterization, self.triangles)

    @cached_property
    def worst(self) -> usability.Worst:
        """State of the metrics of starved parts."""
        return usability.Worst(self.mesh, self.distortion)

    @cached_property
    def worst_without_spanning(self) -> usability.Worst:
        """The same over the faces that span no seam."""
        if not self.spanning.any():
            return self.worst
        return usability.Worst(self.mesh, self.distortion_without_spanning)

    @cached_property
    def layout(self) -> usability.Layout:
        """State of the metrics of the seam's shape and of the unit square."""
        return usability.Layout(self.mesh, self.parameterization, self.triangles)

    @cached_property
    def seams(self) -> seams.Seams:
        """State of the metrics of seams, charts and packing."""
        return seams.Seams(self.mesh, self.parameterization, self.triangles, self.validity.overlaps)

    @cached_property
    def reference_state(self) -> MapState:
        """The reference map with what its metrics need.

        Raises:
            InputError: there is no reference.
        """
        if self.reference is None:
            raise InputError("this metric needs a reference map")
        return MapState(self.mesh, self.reference)


def coverage(state: MapState | pointwise.PointMap) -> float:
    """Share of the surface's area (of a cloud: of its points) that has a uv, from 0 to 1."""
    return state.coverage


def spanning_fraction(state: MapState) -> float:
    """Fraction of the faces that span a seam."""
    return float(state.spanning.mean())


def artist_correlation(state: MapState) -> float:
    """abs(rho - 1), rho the correlation of log sigma with the reference, by area (Shay et al.).

    Both singular values of each face count; faces degenerate in either map are left out. A map
    without any variation of sigma correlates perfectly with another such map, else not at all.
    inf where no face is left.
    """
    ours, theirs = state.triangles, state.reference_state.triangles
    kept = ~(ours.degenerate_3d | ours.degenerate_uv | theirs.degenerate_uv)
    if not kept.any():
        return float("inf")
    weights = np.tile(ours.area[kept] / ours.area[kept].sum() / 2, 2)

    def centred(of: Triangles) -> FloatArray:
        logs = np.log(np.concatenate([of.sigma1[kept], of.sigma2[kept]]))
        return np.asarray(logs - weights @ logs)

    a, b = centred(ours), centred(theirs)
    a_variance, b_variance = float(weights @ a**2), float(weights @ b**2)
    # Deviations of less than 1e-12 are rounding: an isometry.
    constant = (a_variance < 1e-24, b_variance < 1e-24)
    if any(constant):
        return 0.0 if all(constant) else 1.0
    return abs(float(weights @ (a * b)) / float(np.sqrt(a_variance * b_variance)) - 1)


def seam_excess(state: MapState) -> float:
    """Seam length beyond that of the reference, 0 if it is no longer (Shay et al.)."""
    ours = seams.seam_length(state.seams)
    theirs = seams.seam_length(state.reference_state.seams)
    return max(ours - theirs, 0.0) if ours < np.inf else ours


def _twice(everywhere: Metric, without: Callable[[MapState], float]) -> list[Metric]:
    """A metric over all faces, and over those that span no seam."""
    name, label = everywhere.name + WITHOUT_SPANNING, everywhere.label + " without spanning faces"
    return [everywhere, replace(everywhere, name=name, label=label, function=without)]


def _of_distortion(
    group: Group, function: Callable[[FaceDistortion], float], label: str, **about: Any
) -> list[Metric]:
    """A metric of that name over all faces, and over those that span no seam."""
    everywhere = Metric(
        name=function.__name__,
        label=label,
        group=group,
        function=lambda state: function(state.distortion),
        **about,
    )
    return _twice(everywhere, lambda state: function(state.distortion_without_spanning))


def _of_validity(
    function: Callable[[validity.Validity], float], label: str, **about: Any
) -> list[Metric]:
    name, of = function.__name__, lambda state: function(state.validity)
    return [Metric(name=name, label=label, group="validity", function=of, **about)]


def _of_validity_twice(
    function: Callable[[validity.Validity], float], label: str, **about: Any
) -> list[Metric]:
    """A metric of that name over all faces, and over those that span no seam."""
    (everywhere,) = _of_validity(function, label, **about)
    return _twice(everywhere, lambda state: function(state.validity_without_spanning))


def _of_worst(
    function: Callable[[usability.Worst], float], label: str, **about: Any
) -> list[Metric]:
    """A metric of that name over all faces, and over those that span no seam."""
    everywhere = Metric(
        name=function.__name__,
        label=label,
        group="use",
        function=lambda state: function(state.worst),
        **about,
    )
    return _twice(everywhere, lambda state: function(state.worst_without_spanning))


def _of_layout(
    function: Callable[[usability.Layout], float], label: str, **about: Any
) -> list[Metric]:
    name, of = function.__name__, lambda state: function(state.layout)
    return [Metric(name=name, label=label, group="use", function=of, **about)]


def _of_seams(function: Callable[[seams.Seams], float], label: str, **about: Any) -> list[Metric]:
    name, of = function.__name__, lambda state: function(state.seams)
    return [Metric(name=name, label=label, group="seams", function=of, **about)]


def _of_map(group: Group, function: Callable[[Any], float], label: str, **about: Any) -> Metric:
    name = function.__name__
    return Metric(name=name, label=label, group=group, function=function, **about)


_CORNERS = {"weighting": "corners, unweighted", "source": "ParaPoint, supplement; FAM"}
_FACES = {"weighting": "faces, unweighted", "source": "this project"}
_POINTS = {"weighting": "points, unweighted", "source": "this project"}
_RANKS = _POINTS | {"source": "Venna, Kaski 2001", "better": "higher", "ideal": 1.0}
_SHAY = "Shay, Solomon, Stein"
_SANDER = "Sander et al. 2001"
_SORKINE = "Sorkine et al. 2002"
_AREA = {"weighting": "3D area"}
_LARGEST = {"weighting": "none (maximum)"}
_SCALED = {"normalization": "areas sum to 1"}
_RADIANS = {"unit": "radians"}
_SEAM = {"weighting": "3D length, each seam once", "source": _SHAY, "normalization": "/ √3D area"}
_TORN = "without points where the map tears"


def _conformal() -> list[Metric]:
    of, d = partial(_of_distortion, "conformal"), distortion
    label = "angle difference"
    return [
        *of(d.angle_difference_mean, f"{label}, mean", **_CORNERS, **_RADIANS),
        *of(
            d.angle_difference_area_weighted,
            f"{label}, area-weighted",
            **_AREA | _RADIANS,
            source=_SHAY,
        ),
        *of(d.angle_difference_p95, f"{label}, 95th percentile", **_CORNERS, **_RADIANS),
        *of(d.angle_difference_max, f"{label}, largest", **_CORNERS | _LARGEST, **_RADIANS),
        *of(
            d.angle_discrepancy_total,
            "angle discrepancy, total",
            **_AREA | _RADIANS,
            source=_SHAY,
            normalization="3D areas sum to 1, sum over 3 corners",
        ),
        *of(d.angle_distortion_max, "σ1/σ2 + σ2/σ1 - 2, largest", **_LARGEST, source=_SHAY),
        *of(d.quasi_conformal_mean, "σ1/σ2, mean", **_AREA, source=f"{_SANDER}; BFF", ideal=1.0),
        *of(d.quasi_conformal_p95, "σ1/σ2, 95th percentile", **_AREA, source="BFF", ideal=1.0),
        *of(d.quasi_conformal_max, "σ1/σ2, largest", **_LARGEST, source="BFF", ideal=1.0),
    ]


def _authalic() -> list[Metric]:
    of, d = partial(_of_distortion, "authalic"), distortion
    return [
        *of(
            d.area_discrepancy_total,
            "area discrepancy, total",
            weighting="sum",
            source=_SHAY,
            normalization="areas sum to 1; at most 2",
        ),
        *of(d.area_distortion_max, "a/A + A/a - 2, largest", **_LARGEST | _SCALED, source=_SHAY),
        *of(d.area_log_ratio_mean, "|log a/A|, mean", **_AREA | _SCALED, source=_SORKINE),
        *of(
            d.area_ratio_clipped_mean,
            "max(a/A, A/a) clipped at 10, mean",
            **_FACES | _SCALED | {"source": "PartUV"},
            ideal=1.0,
        ),
    ]


def _isometric() -> list[Metric]:
    of, d = partial(_of_distortion, "isometric"), distortion
    mean, largest = _AREA | _SCALED, _LARGEST | _SCALED
    return [
        *of(
            d.symmetric_dirichlet,
            "symmetric Dirichlet energy",
            **mean,
            source="SLIM; OptCuts",
            ideal=4.0,
        ),
        *of(d.stretch_l2, "L2 stretch", **mean, source=_SANDER, ideal=1.0),
        *of(d.stretch_linf, "L∞ stretch", **largest, source=_SANDER, ideal=1.0),
        *of(d.isometric_distortion_mean, "max(σ1, 1/σ2), mean", **mean, source=_SORKINE, ideal=1.0),
        *of(
            d.isometric_distortion_max,
            "max(σ1, 1/σ2), largest",
            **largest,
            source=_SORKINE,
            ideal=1.0,
        ),
        *of(
            d.singular_value_min,
            "σ2, smallest",
            weighting="none (minimum)",
            source=_SHAY,
            **_SCALED,
            better="higher",
            ideal=1.0,
        ),
        *of(d.singular_value_max, "σ1, largest", **largest, source=_SHAY, ideal=1.0),
    ]


def _validity() -> list[Metric]:
    of, twice, v = _of_validity, _of_validity_twice, validity
    count = _FACES | {"weighting": "count", "unit": "faces"}
    return [
        *twice(
            v.flipped_fraction,
            "flipped faces",
            **_FACES,
            normalization="fraction of all faces, by chart majority",
        ),
        *of(
            v.flipped_fraction_global,
            "flipped faces, global",
            **_FACES | {"source": _SHAY},
            normalization="min(p, 1 - p) of the clockwise fraction p",
        ),
        *twice(
            v.flipped_area_fraction,
            "flipped area",
            **_AREA,
            source="this project",
            normalization="fraction of the 3D area, by chart majority",
        ),
        *twice(
            v.flipped_uv_area_fraction,
            "flipped UV area",
            weighting="UV area",
            source="this project",
            normalization="fraction of the UV area",
        ),
        *of(v.degenerate_uv_count, "degenerate in UV only", **count),
        *of(v.degenerate_3d_count, "degenerate in 3D", **count),
        *twice(
            v.overlap_area,
            "overlap area",
            **_AREA,
            source=_SHAY,
            normalization="fraction of the 3D area, over ordered pairs",
        ),
        *of(
            v.overlap_pair_fraction,
            "overlapping pairs",
            weighting="pairs, unweighted",
            source="FAM",
            normalization="fraction of all pairs; neighbours do not count",
        ),
        *of(
            v.overlapped_fraction,
            "overlapped faces",
            **_AREA,
            source="this project",
            normalization="fraction of the 3D area",
        ),
        *of(
            v.bijective,
            "bijective",
            **_FACES,
            normalization="1 yes, 0 no",
            better="higher",
            ideal=1.0,
        ),
    ]


def _use() -> list[Metric]:
    worst, layout, u = _of_worst, _of_layout, usability
    ratio = {"normalization": "r = a/A, areas sum to 1"}
    return [
        *worst(
            u.part_area_ratio_min,
            "smallest mean r of a starved part",
            **_AREA,
            source="this project",
            normalization="r = a/A; parts with r < 1/4 of at least 1 % of the area; 1 for none",
            better="higher",
            ideal=1.0,
        ),
        *worst(
            u.starved_area_fraction,
            "starved area",
            **_AREA,
            source="this project",
            normalization="fraction of the 3D area with r = a/A < 1/4",
        ),
        *worst(
            u.area_ratio_p01,
            "r, 1st percentile",
            **_AREA | ratio,
            source="this project",
            better="higher",
            ideal=1.0,
        ),
        *layout(
            u.seam_jaggedness,
            "seam jaggedness",
            weighting="3D length",
            source="this project",
            normalization="length / length smoothed over four edges",
            ideal=1.0,
        ),
        *layout(
            u.uv_outside_unit,
            "UV outside of the unit square",
            **_LARGEST,
            source="this project",
            normalization="sides of the square",
        ),
        *layout(
            u.mirrored_area_fraction,
            "mirrored UV area",
            weighting="UV area",
            source="this project",
            normalization="fraction of the UV area that turns against the faces",
        ),
        _of_map(
            "use",
            coverage,
            "coverage",
            **_AREA,
            source="this project",
            normalization="fraction of the area (of a cloud: of the points) with a uv",
            better="higher",
            ideal=1.0,
        ),
    ]


def _seams() -> list[Metric]:
    of, s = _of_seams, seams
    return [
        _of_map(
            "seams",
            spanning_fraction,
            "faces that span a seam",
            **_FACES,
            normalization="fraction of all faces",
        ),
        *of(s.chart_count, "charts", weighting="count", source="PartUV", ideal=1.0),
        *of(s.seam_length, "seam length", **_SEAM, ideal=None),
        *of(
            s.uv_boundary_length,
            "UV boundary length",
            weighting="UV length",
            source=_SHAY,
            normalization="/ √UV area",
            ideal=None,
        ),
        *of(
            s.packing_efficiency,
            "packing efficiency",
            weighting="UV area, no double cover",
            source=_SHAY,
            normalization="fraction of the square bounding box",
            better="higher",
            ideal=1.0,
        ),
        *of(
            s.resolution,
            "resolution, largest 1/σ2",
            **_LARGEST,
            source=_SHAY,
            normalization="UV in the unit square, mesh unscaled",
            ideal=None,
        ),
    ]


def _reference() -> list[Metric]:
    of = partial(_of_map, "reference")
    return [
        of(artist_correlation, "|ρ(log σ, log σ of reference) - 1|", **_AREA, source=_SHAY),
        of(seam_excess, "seam length beyond the reference's", **_SEAM),
    ]


def _points() -> list[Metric]:
    of, p = partial(_of_map, "points"), pointwise
    share = _POINTS | {"normalization": "fraction of the points"}
    return [
        of(p.local_quasi_conformal_mean, "local σ1/σ2, mean", **_POINTS, ideal=1.0),
        of(
            p.local_quasi_conformal_mean_without_spanning,
            "local σ1/σ2, mean",
            **_POINTS,
            normalization=_TORN,
            ideal=1.0,
        ),
        of(
            p.local_area_log_ratio_mean,
            "local |log σ1σ2|, mean",
            **_POINTS,
            normalization="from its median",
        ),
        of(
            p.local_area_log_ratio_mean_without_spanning,
            "local |log σ1σ2|, mean",
            **_POINTS,
            normalization=f"from its median, {_TORN}",
        ),
        of(
            p.neighbour_preservation,
            "neighbours preserved",
            **_RANKS,
            normalization="the smaller of the next two",
        ),
        of(p.neighbour_trustworthiness, "trustworthiness", **_RANKS, normalization="k = 8"),
        of(p.neighbour_continuity, "continuity", **_RANKS, normalization="k = 8"),
        of(
            p.point_part_area_ratio_min,
            "smallest mean r of a starved part",
            **_POINTS | {"better": "higher", "ideal": 1.0},
            normalization="r = local area / mean; parts with r < 1/4 of 1 % of the points",
        ),
        of(
            p.starved_point_fraction,
            "starved points",
            **_POINTS,
            normalization="fraction with a local area below a quarter of the mean",
        ),
        of(p.uv_collision_fraction, "UV collisions", **share),
        of(
            p.seam_point_fraction,
            "seam points, K = 3, T = 1 % of L",
            **share | {"source": "ParaPoint, seam extraction"},
            ideal=None,
        ),
        of(p.spanning_point_fraction, "points where the map tears", **share, ideal=None),
    ]


METRICS: dict[str, Metric] = {
    metric.name: metric
    for metric in (
        *_conformal(),
        *_authalic(),
        *_isometric(),
        *_validity(),
        *_use(),
        *_seams(),
        *_reference(),
        *_points(),
    )
}


def evaluate(
    mesh: Mesh, parameterization: Parameterization, reference: Parameterization | None = None
) -> dict[str, float]:
    """Every metric of a map of a mesh, by name; never nan.

    Args:
        mesh: the surface, as it was before any cut: seams are where the map leaves its edges.
        parameterization: the map, its faces in the order of the mesh.
        reference: another map of the same faces; without it the group "reference" is left out.

    Raises:
        InputError: a map has another number of faces than the mesh.
    """
    return values(MapState(mesh, parameterization, reference))


def values(state: MapState) -> dict[str, float]:
    """Every metric that `state` can have, by name."""
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
