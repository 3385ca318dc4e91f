"""The grade of a map: whether it may be ranked, and whether it is of use.

Faces that span a seam do not count. A **broken** map is shown, and never ranked. A **collapsed**
one is ranked by its angles alone. A **usable** one is fit for use, and counts as a success. Any
other map is **flawed**: it is ranked, and does not count as a success.

A face without an area in the plane is left out of the mean distortion. So this is infinite, and the
map broken, only where no face has such an area.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from parapoint.surfaces.areas import LEAST_PART, MOST_STARVED

Grade = Literal["broken", "collapsed", "flawed", "usable"]
GRADES: tuple[Grade, ...] = ("broken", "collapsed", "flawed", "usable")
"""All grades, from the worst to the best."""

BROKEN = 0.05
"""Fraction of the surface that may be flipped, or overlapped, before a map counts as broken."""
FLIPPED = 0.005
"""Fraction of the faces that a usable map of a cloud may flip."""
OVERLAPPED = 0.01
"""Fraction of the surface that a usable map of a cloud may overlap. For a cloud without faces, the
fraction of the points that may collide."""
WHOLE = 0.95
"""Fraction of the surface, or of the points of a cloud without faces, that a usable map covers at
least. A method whose maps cover less on most surfaces is not ranked among those of the whole."""

FROM_POINTS = frozenset(
    {
        *("parapoint", "computed", "meshed", "textured", "fam", "nuvo", "foldingnet", "atlasnet"),
        *("diffsr", "elestruc", "gtif", "tearingnet", "flattening_net", "reggeonet"),
    }
)
"""Methods whose maps are made of points alone, so that a few flips at a face are forgiven."""

BOUNDS = (
    f"broken: more than {BROKEN:.0%} of the surface flipped or overlapped, or no face with an area "
    f"in the map; collapsed: a part of at least {LEAST_PART:.0%} of the surface has less than a "
    f"quarter of its fair area; usable: no flips and overlaps (of a cloud at most {FLIPPED:.1%} "
    f"and {OVERLAPPED:.0%}), nothing collapsed, at most {MOST_STARVED:.0%} starved, at least "
    f"{WHOLE:.0%} of the surface mapped; flawed: the rest"
)
"""What the grades mean, in one line for the notes of a table.

For a cloud without faces, points that collide take the place of overlaps, and nothing that of
flips; parts and starving are those of points.
"""


def grade(values: Mapping[str, float], *, of_cloud: bool) -> Grade:
    """The grade of a map whose metrics (`benchmarks.metrics.evaluation`) are given.

    Args:
        values: metrics by name.
        of_cloud: whether the method was given points without faces, so that a few flips are
            forgiven.

    Raises:
        KeyError: a metric that the grade needs is missing.
    """
    if "local_quasi_conformal_mean" in values:
        return _grade_of_points(values)
    flipped, overlapped, degenerate, smallest, starved, coverage = (
        values[name]
        for name in (
            "flipped_area_fraction_without_spanning",
            "overlap_area_without_spanning",
            "degenerate_uv_count",
            "part_area_ratio_min_without_spanning",
            "starved_area_fraction_without_spanning",
            "coverage",
        )
    )
    finite = math.isfinite(values["symmetric_dirichlet_without_spanning"])
    if not finite or not (flipped <= BROKEN and overlapped <= BROKEN):
        return "broken"
    if smallest < 1:
        return "collapsed"
    faces = values["flipped_fraction_without_spanning"]
    is_sound = (
        faces <= FLIPPED and overlapped <= OVERLAPPED
        if of_cloud
        else faces == 0 and overlapped == 0 and degenerate == 0
    )
    is_enough = starved <= MOST_STARVED and coverage >= WHOLE
    return "usable" if is_sound and is_enough else "flawed"


def grade_of(method: str, values: Mapping[str, object]) -> Grade | None:
    """The grade of a cell; None where it has no map or lacks a metric that the grade needs.

    Args:
        method: registry name.
        values: the cell's metrics by name; those it does not have are missing or nan.
    """
    known = {
        name: float(value)
        for name, value in values.items()
        if isinstance(value, int | float) and not math.isnan(value)
    }
    try:
        return grade(known, of_cloud=method in FROM_POINTS)
    except KeyError:
        return None


def _grade_of_points(values: Mapping[str, float]) -> Grade:
    """The grade of a map of a cloud without faces; collisions of points count as overlaps.

    It is broken, too, where at no point the map has two directions.
    """
    collided = values["uv_collision_fraction"]
    if not (math.isfinite(values["local_quasi_conformal_mean"]) and collided <= BROKEN):
        return "broken"
    if values["point_part_area_ratio_min"] < 1:
        return "collapsed"
    is_enough = values["starved_point_fraction"] <= MOST_STARVED and values["coverage"] >= WHOLE
    return "usable" if collided <= OVERLAPPED and is_enough else "flawed"
