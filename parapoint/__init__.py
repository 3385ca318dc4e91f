"""ParaPoint: global, free-boundary UV maps of raw 3D point clouds, and the types around them.

Importing this package imports nothing else: what is in it comes with its first use, so that
commands answer at once and torch is loaded only where it computes.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from parapoint.computed.computed_map import ComputedMap
    from parapoint.errors import InputError, NotFittedError
    from parapoint.learned.parapoint import ParaPoint
    from parapoint.method import Method
    from parapoint.surfaces.parameterization import Parameterization, PointParameterization
    from parapoint.surfaces.surface import Mesh, PointCloud

__version__ = "0.2.0"
__all__ = [
    "ComputedMap",
    "InputError",
    "Mesh",
    "Method",
    "NotFittedError",
    "ParaPoint",
    "Parameterization",
    "PointCloud",
    "PointParameterization",
]

LAZY = {
    "ComputedMap": "computed.computed_map",
    "InputError": "errors",
    "Mesh": "surfaces.surface",
    "Method": "method",
    "NotFittedError": "errors",
    "ParaPoint": "learned.parapoint",
    "Parameterization": "surfaces.parameterization",
    "PointCloud": "surfaces.surface",
    "PointParameterization": "surfaces.parameterization",
}
"""The module, under `parapoint`, of each name that this package offers."""


def __getattr__(name: str) -> object:
    if name not in LAZY:
        raise AttributeError(f"module 'parapoint' has no attribute {name!r}")
    return getattr(importlib.import_module(f"parapoint.{LAZY[name]}"), name)
