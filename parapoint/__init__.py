"""ParaPoint: global, free-boundary UV maps of raw 3D point clouds, and the types around them.

Importing this package does not import torch; `parapoint.ParaPoint` does, at first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from parapoint.errors import InputError
from parapoint.method import Method
from parapoint.parameterization import Parameterization, PointParameterization
from parapoint.surface import Mesh, PointCloud

if TYPE_CHECKING:
    from parapoint.estimator import ParaPoint

__version__ = "0.1.0"
__all__ = [
    "InputError",
    "Mesh",
    "Method",
    "ParaPoint",
    "Parameterization",
    "PointCloud",
    "PointParameterization",
]


def __getattr__(name: str) -> object:
    if name == "ParaPoint":
        from parapoint.estimator import ParaPoint

        return ParaPoint
    raise AttributeError(f"module 'parapoint' has no attribute {name!r}")
