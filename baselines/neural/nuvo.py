"""Charts in the manner of Nuvo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.method import NeuralMethod
from parapoint.parameters import check_whole
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Surface

if TYPE_CHECKING:
    from baselines.neural.training import SurfaceTrainer


@dataclass(frozen=True)
class SingleChart(NeuralMethod):
    """Nuvo with a single chart."""

    def trainer(self) -> type[SurfaceTrainer]:
        """See `NeuralMethod`."""
        from baselines.neural.nuvo_training import NuvoTrainer

        return NuvoTrainer


@dataclass(frozen=True)
class Nuvo(NeuralMethod):
    """A neural map to unit squares in the manner of Nuvo, with a single chart or with several.

    P. P. Srinivasan, S. J. Garbin, D. Verbin, J. T. Barron and B. Mildenhall 2023, "Nuvo: Neural
    UV Mapping for Unruly 3D Representations": texture coordinates t and surface coordinates s that
    invert each other, s on the surface, perpendicular images of perpendicular tangents (which
    leaves stretch along them free), even areas. With a single chart it compares with other global
    maps; weights are those of a public reimplementation, the optimiser and its steps are
    ParaPoint's. Several charts, as Nuvo has them, share the surface by probabilities, which weigh
    the terms of a point in each chart; s of a chart's square has to be its own (entropy), and a
    chart's points lie together (cluster). A face goes to the chart that is most probable at its
    centre; the squares are packed, each by its area. Left out: the term of the texture, and the
    radiance fields from which Nuvo takes its points; with several charts the networks are smaller.

    Attributes:
        charts: 1 to 16; some may end up without a face.
    """

    charts: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("charts", self.charts, 1, 16)

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """See `NeuralMethod`."""
        if self.charts == 1:
            single = SingleChart(self.points, self.iterations, self.subset, self.time_budget)
            return single.parameterize(surface, seed=seed)
        from baselines.neural.nuvo_charts import charted

        return charted(self, surface, seed)
