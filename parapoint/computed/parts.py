"""A conformal map made to keep every part: longer seams, and angles given up where need be.

A conformal map along short seams shrinks what sticks out, an ear or a finger, to almost nothing.
Where seams that were led there (`parapoint.computed.seams`) do not help, or where areas are to be
kept as angles are, the symmetric Dirichlet energy does: it punishes what is small. It is brought
down first, and the seam led on to where the map still starves the surface of area. For a balanced
map the conformal energy is then brought down again, as far as no part pays for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, get_args

import igl
import numpy as np

from parapoint.planar.bijection import is_bijective
from parapoint.planar.descent import Run
from parapoint.planar.growth import Need, grown
from parapoint.planar.scaffold import LEAST_GAIN, excess, of_area_one, steps_down
from parapoint.surfaces.areas import LEAST_PART, signed_areas, starved_share
from parapoint.surfaces.surface import FloatArray, Mesh

Distortion = Literal["conformal", "balanced", "isometric"]
DISTORTIONS: tuple[Distortion, ...] = get_args(Distortion)
"""What a map keeps: "conformal" angles, whatever becomes of the parts; "balanced" angles as far as
every part keeps its area; "isometric" angles and areas alike."""

HALVINGS = 5
"""A step that would starve a part is shortened to within 2 to the power of minus this."""


def parts_kept(
    disk: Mesh, uv: FloatArray, distortion: Distortion, deadline: float = math.inf
) -> tuple[Mesh, FloatArray]:
    """The domain, its seam perhaps longer, and a one-to-one map of it that starves no part.

    Where the time is up, or no branch of the seam helps, a part may stay starved. A balanced map
    never starves more than the conformal one.

    Args:
        disk: a planar domain, faces counter-clockwise.
        uv: (V, 2) a conformal map of it, one to one.
        distortion: one of DISTORTIONS.
        deadline: no step begins after this time of `clock.worked`.
    """
    if distortion == "conformal":
        return disk, uv
    starved = starved_share(disk, uv)
    if distortion == "balanced" and starved <= LEAST_PART:
        return disk, uv
    conformal = disk, uv
    size = np.sqrt(disk.face_areas.sum())
    unit = of_area_one(disk.vertices, disk.faces)
    uv = uv / np.sqrt(signed_areas(uv, unit.faces).sum())
    run = Run(unit, deadline)
    run.take(uv, "conformal")
    run.improve()
    run = grown(run, Need())
    unit, uv = run.mesh, run.uv
    if distortion == "balanced":
        uv = towards_conformal(unit, uv, deadline)
        if starved_share(unit, uv) > starved:
            return conformal
    return Mesh(size * unit.vertices, unit.faces), size * uv


def towards_conformal(
    disk: Mesh, uv: FloatArray, deadline: float, most_starved: float = LEAST_PART
) -> FloatArray:
    """The map `uv` (V, 2) moved down the conformal energy until the next move starves too much.

    Args:
        disk: the domain, of area 1.
        uv: (V, 2) a map of it, one to one, of area 1 or so.
        deadline: no step begins after this time of `clock.worked`.
        most_starved: share of the surface that may be starved of area.
    """

    def is_sound(moved: FloatArray) -> bool:
        return starved_share(disk, moved) <= most_starved and is_bijective(disk, moved)

    before = math.inf
    for moved in steps_down(disk, uv, igl.CONFORMAL, deadline):
        after = excess(disk, moved, igl.CONFORMAL)
        if not is_sound(moved):
            return _as_far(uv, moved, is_sound)
        uv = moved
        if not before - after > LEAST_GAIN * after:
            break
        before = after
    return uv


def _as_far(
    uv: FloatArray, moved: FloatArray, is_sound: Callable[[FloatArray], bool]
) -> FloatArray:
    """The map between `uv` and `moved`, both (V, 2), that is as near to `moved` as is sound."""
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        if is_sound(uv + middle * (moved - uv)):
            low = middle
        else:
            high = middle
    return np.asarray(uv + low * (moved - uv))
