"""What the neural rivals share: parameters, training data, the map at the surface's points."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import igl
import numpy as np
from scipy.spatial import cKDTree

from parapoint.learned.presets import LARGEST, Preset
from parapoint.parameters import LONGEST_SECONDS, check_number, check_whole
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sampling import FEWEST_POINTS, training_points
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

if TYPE_CHECKING:
    from baselines.neural.training import SurfaceTrainer

BATCH = 4_096
"""Points mapped at a time."""
KEPT_MAPS = 8
"""Maps kept in the trace."""


@dataclass(frozen=True)
class NeuralMethod:
    """A map R³ → R² learned for one surface; base class of the rivals.

    Attributes:
        points: training points, 100 at least, drawn as for ParaPoint.
        iterations: steps.
        subset: points of a step, 100 at least, or all if there are fewer; see `Trainer` on time
            budgets.
        time_budget: seconds of training at most; the schedule follows the time where that ends
            sooner.
        on_cpu: whether it trains on the CPU even where there is a GPU.
    """

    points: int = 10_000
    iterations: int = 10_000
    subset: int = 10_000
    time_budget: float | None = None

    requires: ClassVar[frozenset[str]] = frozenset()
    packages: ClassVar[tuple[str, ...]] = ("torch",)
    on_cpu: ClassVar[bool] = False
    schedule: ClassVar[Preset] = Preset(all_from=1.0, warm_up=0.0, perturbation=0.0)

    def trainer(self) -> type[SurfaceTrainer]:
        """What trains its networks; importing it needs torch, which a list of methods must not."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        for name, least in (
            ("points", FEWEST_POINTS),
            ("iterations", 1),
            ("subset", FEWEST_POINTS),
        ):
            check_whole(name, getattr(self, name), least, LARGEST)
        if self.time_budget is not None:
            check_number("time_budget", self.time_budget, most=LONGEST_SECONDS, above=True)

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: not where time ends the run, nor on CUDA."""
        import torch

        return self.time_budget is None and (self.on_cpu or not torch.cuda.is_available())

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """The map at the vertices of a mesh or the points of a cloud, in the unit of the surface.

        Raises:
            InputError: fewer than 100 distinct points, or all on a line.
            DivergedError: the training diverged, and again with a smaller step.
        """
        import torch

        cloud = training_points(surface, self.points, seed)
        centre = (cloud.min(axis=0) + cloud.max(axis=0)) / 2
        scale = float(np.linalg.norm(cloud - centre, axis=1).max())
        budget = {k: v for k, v in asdict(self).items() if k != "time_budget"}
        trainer = self.trainer()(
            (cloud - centre) / scale,
            surface_normals(surface, cloud),
            replace(self.schedule, **budget),
            seed=seed,
            time_budget=self.time_budget,
        )
        everywhere = surface.vertices if isinstance(surface, Mesh) else surface.points
        at = torch.as_tensor((everywhere - centre) / scale, dtype=torch.float32)

        def uv() -> FloatArray:
            with torch.no_grad():
                parts = [
                    trainer.networks.parameterization(part.to(trainer.device)).cpu()
                    for part in torch.split(at, BATCH)
                ]
            return scale * torch.cat(parts).numpy().astype(np.float64)

        trace: list[TracePoint] = []
        kept = 0
        for step in trainer.run():
            if step.losses:
                is_due = step.progress * KEPT_MAPS >= kept + 1
                kept += is_due
                map_now = uv() if is_due else None
                trace.append(TracePoint(step.iteration, step.seconds, step.losses, map_now))
        report: dict[str, object] = {
            "points": len(cloud),
            "points_of_a_step": min(trainer.subset, len(cloud)),
            "iterations": trainer.iteration,
            "weights": trainer.weights,
            "losses": dict(trace[-1].values),
            "divergences": trainer.divergences,
            "device": trainer.device,
        }
        if isinstance(surface, Mesh):
            return Parameterization(uv(), surface.faces, tuple(trace), report)
        return PointParameterization(uv(), tuple(trace), report)


def surface_normals(surface: Surface, at: FloatArray) -> FloatArray | None:
    """(N, 3) unit normals of the surface at points (N, 3) of it; None where a cloud has none.

    Those of the nearest vertex or point.
    """
    if isinstance(surface, Mesh):
        points = surface.vertices[surface.referenced]
        normals = igl.per_vertex_normals(surface.vertices, surface.faces)[surface.referenced]
    elif surface.normals is not None:
        points, normals = surface.points, surface.normals
    else:
        return None
    return np.asarray(normals[cKDTree(points).query(at)[1]], dtype=np.float64)
