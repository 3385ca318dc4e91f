"""A single chart in the manner of Nuvo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.method import NeuralMethod

if TYPE_CHECKING:
    from baselines.neural.training import SurfaceTrainer


@dataclass(frozen=True)
class Nuvo(NeuralMethod):
    """A neural map to the unit square in the manner of Nuvo, with a single chart.

    P. P. Srinivasan, S. J. Garbin, D. Verbin, J. T. Barron and B. Mildenhall 2023, "Nuvo: Neural
    UV Mapping for Unruly 3D Representations": texture coordinates t and surface coordinates s that
    invert each other, s on the surface, perpendicular images of perpendicular tangents (which
    leaves stretch along them free), even areas. Nuvo has several charts, this stand-in has one, so
    that it compares with other global maps; weights are those of a public reimplementation, the
    optimiser and its steps are ParaPoint's.
    """

    def trainer(self) -> type[SurfaceTrainer]:
        """See `NeuralMethod`."""
        from baselines.neural.nuvo_training import NuvoTrainer

        return NuvoTrainer
