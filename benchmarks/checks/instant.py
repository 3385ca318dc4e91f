"""A method that takes no time, so that all the time of a run is that of the harness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface


@dataclass(frozen=True)
class Instant:
    """The orthogonal projection along z, scaled.

    Attributes:
        variant: a number by which methods differ, so that a run can have any number of them.
    """

    variant: int = 0

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:
        """The first two coordinates, with a scale of its own for each variant and seed."""
        assert isinstance(surface, Mesh)
        scale = 1 + self.variant + seed / 10
        return Parameterization(surface.vertices[:, :2] * scale, surface.faces)
