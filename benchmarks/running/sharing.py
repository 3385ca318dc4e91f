"""The time budget of a method that maps a surface part by part."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from parapoint.method import Method
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, Surface

LEAST = 1e-3
"""Seconds that the smallest part gets."""


def sharing(method: Method, parts: Sequence[Surface]) -> Method:
    """The method; if several parts share its time budget, one that gives each part its share."""
    area = sum(map(_area, parts))
    has_budget = getattr(method, "time_budget", None) is not None
    return Shared(method, area) if has_budget and len(parts) > 1 and area > 0 else method


@dataclass(frozen=True)
class Shared:
    """A method that gives a part as much of its time budget as the part has of the area.

    Attributes:
        method: a dataclass with a field `time_budget`, in seconds.
        area: that of all parts.
    """

    method: Any
    area: float

    requires: ClassVar[frozenset[str]] = frozenset()

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """The map of a part, in its share of the time."""
        budget = max(_area(surface) / self.area * self.method.time_budget, LEAST)
        method: Method = replace(self.method, time_budget=budget)
        return method.parameterize(surface, seed=seed)


def _area(surface: Surface) -> float:
    """The area of a mesh; clouds have none, and no parts."""
    return float(surface.face_areas.sum()) if isinstance(surface, Mesh) else 0.0
