"""Energies of a map, and libigl's descent of them."""

from __future__ import annotations

from collections.abc import Callable

import igl
import numpy as np

from parapoint.planar.domains import Domain
from parapoint.planar.scaffold import LARGE
from parapoint.surfaces.surface import FloatArray

Density = Callable[[FloatArray, FloatArray], FloatArray]

DENSITIES: dict[str, tuple[Density, float]] = {
    "symmetric_dirichlet": (lambda s1, s2: s1**2 + s1**-2 + s2**2 + s2**-2, 4.0),
    "conformal": (lambda s1, s2: (s1 / s2 + s2 / s1) / 2, 1.0),
    "log_arap": (lambda s1, s2: np.log(s1) ** 2 + np.log(s2) ** 2, 0.0),
    "exp_conformal": (lambda s1, s2: (s1 / s2 + s2 / s1) / 2, 1.0),
}
"""Energy of a triangle by its singular values (table 1 of the paper), and the least value.

The energy of a map is the area-weighted mean; for `exp_conformal` the logarithm of the mean of
exp(density), which would overflow at a far start.
"""


def stepper(disk: Domain, uv: FloatArray, energy: str) -> Callable[[int], FloatArray]:
    """A function that takes a number of libigl's steps and returns the map (V, 2) after them.

    The unit of the surface makes no difference: see `parapoint.planar.scaffold.LARGE`.

    Args:
        disk: the surface.
        uv: (V, 2) where it starts, without flips.
        energy: key of DENSITIES.
    """
    scale = LARGE / disk.area**0.5
    state = igl.slim_precompute(
        np.asfortranarray(scale * disk.vertices),
        np.asfortranarray(disk.faces.astype(np.int32)),
        np.asfortranarray(scale * uv),
        igl.MappingEnergyType.__members__[energy.upper()],
        np.zeros(0, dtype=np.int32),
        np.zeros((0, 2), order="F"),
        0.0,
    )
    return lambda steps: np.ascontiguousarray(igl.slim_solve(state, steps) / scale)
