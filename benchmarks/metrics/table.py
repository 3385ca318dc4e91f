"""The registry of metrics. Each metric has its entry here, and nowhere else.

METRICS holds every name that a table, a JSON object or `metrics.parquet` may have. Each distortion
metric has two entries. The second, `_without_spanning`, leaves out the faces that span a seam
(`benchmarks.metrics.seams`) and is normalized over the others.

To add a metric, write the function that computes it, and add its entry here.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from benchmarks.metrics import distortion, pointwise, reference, seams, usability, validity
from benchmarks.metrics.metric import WITHOUT_SPANNING, Group, Metric


def _entries(group: Group, part: str, *, twice: bool = False) -> Callable[..., list[Metric]]:
    """A function that makes the entries of a metric, which is named like the function it calls.

    Args:
        group: the table that it belongs to.
        part: the attribute of a MapState that the function takes; "" for the state itself.
        twice: whether a second entry leaves out the faces that span a seam.
    """

    def entries(function: Callable[[Any], float], label: str, **about: Any) -> list[Metric]:
        def value(part: str, state: Any) -> float:
            return function(getattr(state, part) if part else state)

        name, of_all = function.__name__, partial(value, part)
        everywhere = Metric(name=name, label=label, group=group, function=of_all, **about)
        if not twice:
            return [everywhere]
        other = replace(
            everywhere,
            name=name + WITHOUT_SPANNING,
            label=f"{label} without spanning faces",
            function=partial(value, part + WITHOUT_SPANNING),
        )
        return [everywhere, other]

    return entries


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
    """Metrics of angles."""
    of, d = _entries("conformal", "distortion", twice=True), distortion
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
    """Metrics of areas."""
    of, d = _entries("authalic", "distortion", twice=True), distortion
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
    """Metrics of lengths."""
    of, d = _entries("isometric", "distortion", twice=True), distortion
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
    """Metrics of flipped, degenerate and overlapping faces."""
    of, v = _entries("validity", "validity"), validity
    twice = _entries("validity", "validity", twice=True)
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
    """Metrics of the worst part, and of what a texture needs."""
    worst, u = _entries("use", "worst", twice=True), usability
    layout = _entries("use", "layout")
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
        Metric(
            name="coverage",
            label="coverage",
            group="use",
            function=lambda state: state.coverage,
            **_AREA,
            source="this project",
            normalization="fraction of the area (of a cloud: of the points) with a uv",
            better="higher",
            ideal=1.0,
        ),
    ]


def _seams() -> list[Metric]:
    """Metrics of seams, charts and packing."""
    of, s = _entries("seams", "seams"), seams
    return [
        Metric(
            name="spanning_fraction",
            label="faces that span a seam",
            group="seams",
            function=lambda state: float(state.spanning.mean()),
            weighting="faces, unweighted",
            source="this project",
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
    """Metrics against the reference map."""
    of = _entries("reference", "")
    return [
        *of(
            reference.artist_correlation,
            "|ρ(log σ, log σ of reference) - 1|",
            **_AREA,
            source=_SHAY,
        ),
        *of(reference.seam_excess, "seam length beyond the reference's", **_SEAM),
    ]


def _points() -> list[Metric]:
    """Metrics of a map of a point cloud."""
    of, p = _entries("points", ""), pointwise
    share = _POINTS | {"normalization": "fraction of the points"}
    return [
        *of(p.local_quasi_conformal_mean, "local σ1/σ2, mean", **_POINTS, ideal=1.0),
        *of(
            p.local_quasi_conformal_mean_without_spanning,
            "local σ1/σ2, mean",
            **_POINTS,
            normalization=_TORN,
            ideal=1.0,
        ),
        *of(
            p.local_area_log_ratio_mean,
            "local |log σ1σ2|, mean",
            **_POINTS,
            normalization="from its median",
        ),
        *of(
            p.local_area_log_ratio_mean_without_spanning,
            "local |log σ1σ2|, mean",
            **_POINTS,
            normalization=f"from its median, {_TORN}",
        ),
        *of(
            p.neighbour_preservation,
            "neighbours preserved",
            **_RANKS,
            normalization="the smaller of the next two",
        ),
        *of(p.neighbour_trustworthiness, "trustworthiness", **_RANKS, normalization="k = 8"),
        *of(p.neighbour_continuity, "continuity", **_RANKS, normalization="k = 8"),
        *of(
            p.point_part_area_ratio_min,
            "smallest mean r of a starved part",
            **_POINTS | {"better": "higher", "ideal": 1.0},
            normalization="r = local area / mean; parts with r < 1/4 of 1 % of the points",
        ),
        *of(
            p.starved_point_fraction,
            "starved points",
            **_POINTS,
            normalization="fraction with a local area below a quarter of the mean",
        ),
        *of(p.uv_collision_fraction, "UV collisions", **share),
        *of(
            p.seam_point_fraction,
            "seam points, K = 3, T = 1 % of L",
            **share | {"source": "ParaPoint, seam extraction"},
            ideal=None,
        ),
        *of(p.spanning_point_fraction, "points where the map tears", **share, ideal=None),
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
"""Every metric by name, in the order of the tables."""
