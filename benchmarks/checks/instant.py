"""A method that takes no time: what is left of a run is the harness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface


@dataclass(frozen=True)
class Instant:
    """Orthogonal projection along z, scaled.

    Attributes:
        variant: as many methods as are wanted differ by it.
    """

    variant: int = 0

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:
        """The first two coordinates, scaled by what sets one cell apart from another."""
        assert isinstance(surface, Mesh)
        scale = 1 + self.variant + seed / 10
        return Parameterization(surface.vertices[:, :2] * scale, surface.faces)
