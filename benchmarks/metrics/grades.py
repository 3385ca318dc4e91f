"""Three grades, and what lies between them: whether a map may be ranked, and whether it is of use.

All is read off the faces that span a seam. A **broken** map is shown and never ranked. A
**collapsed** one is ranked in angle columns alone. A **usable** one can be taken home: "success"
counts these. What is neither is **flawed**: it is ranked, but it is no success.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal

from benchmarks.metrics.usability import LEAST_PART

Grade = Literal["broken", "collapsed", "flawed", "usable"]
GRADES: tuple[Grade, ...] = ("broken", "collapsed", "flawed", "usable")
"""From the worst to the best."""

BROKEN = 0.05
"""Share of the surface that may be flipped, or covered twice, before a map counts as broken."""
FLIPPED = 0.005
"""Share of the faces that a usable map of a cloud may flip."""
OVERLAPPED = 0.01
"""Share of the surface that a usable map of a cloud may cover twice; of the points, those that
collide."""
STARVED_SHARE = 0.02
"""Share of the surface that a usable map may starve (see `benchmarks.metrics.usability`)."""

BOUNDS = (
    f"broken: more than {BROKEN:.0%} of the surface flipped or overlapped, or not finite; "
    f"collapsed: a part of at least {LEAST_PART:.0%} of the surface has less than a quarter of its "
    f"fair area; usable: no flips and overlaps (of a cloud at most {FLIPPED:.1%} and "
    f"{OVERLAPPED:.0%}), nothing collapsed, at most {STARVED_SHARE:.0%} starved; flawed: the rest"
)
"""The grades in one line, for the notes of a table."""


def grade(values: Mapping[str, float], *, of_cloud: bool) -> Grade:
    """The grade of a map whose metrics (`benchmarks.metrics.evaluation`) are given.

    Args:
        values: metrics by name.
        of_cloud: whether the map is made of points alone, so that a few flips are forgiven; False
            for a method that was given the faces.

    Raises:
        KeyError: a metric that the grade needs is missing.
    """
    if "local_quasi_conformal_mean" in values:
        return _grade_of_points(values)
    flipped, overlapped, degenerate, smallest, starved = (
        values[name]
        for name in (
            "flipped_area_fraction_without_spanning",
            "overlap_area_without_spanning",
            "degenerate_uv_count",
            "part_area_ratio_min_without_spanning",
            "starved_area_fraction_without_spanning",
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
    return "usable" if is_sound and starved <= STARVED_SHARE else "flawed"


def _grade_of_points(values: Mapping[str, float]) -> Grade:
    """The grade of a map of a cloud without faces: collisions of points stand for overlaps."""
    collided = values["uv_collision_fraction"]
    if not (math.isfinite(values["local_quasi_conformal_mean"]) and collided <= BROKEN):
        return "broken"
    if values["point_part_area_ratio_min"] < 1:
        return "collapsed"
    is_sound = collided <= OVERLAPPED and values["starved_point_fraction"] <= STARVED_SHARE
    return "usable" if is_sound else "flawed"
