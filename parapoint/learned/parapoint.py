"""ParaPoint: the paper's five networks, trained for each surface."""

from __future__ import annotations

import dataclasses
import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from parapoint import clock
from parapoint.estimator import Estimator
from parapoint.fitting import Fitted, Progress, Session
from parapoint.learned import presets
from parapoint.learned.devices import device_of
from parapoint.learned.presets import Preset
from parapoint.parameters import MOST_THREADS, check_whole
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.normals import are_outer, oriented_normals
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.sampling import FEWEST_POINTS, training_points, without_coincident
from parapoint.surfaces.surface import FloatArray, Surface

if TYPE_CHECKING:
    from parapoint.learned.trainer import Step, Trainer

logger = logging.getLogger("parapoint")

STARTED_PER_SECOND = 80
"""Points of a computed start for each second of the time budget: computing it takes a tenth of the
budget on one idle core."""
STARTING = 0.25
"""Share of the time budget after which a computed start is improved no more."""
KEPT_MAPS = 8
"""Maps that go into the trace of `parameterize`, evenly over the run."""


@dataclass(repr=False)
class ParaPoint(Estimator):
    """Global, free-boundary UV maps of point clouds, learned for each (Zhang, Hou and He, 2024).

    Five networks (Deform, Cut, Stitch, Wrap, Unwrap) are trained for the one surface; the map of
    any point comes from them alone.

        >>> import numpy as np
        >>> from parapoint import ParaPoint
        >>> points = np.random.default_rng(0).normal(size=(2000, 3))
        >>> points /= np.linalg.norm(points, axis=1, keepdims=True)
        >>> model = ParaPoint(preset="paper", iterations=500).fit(points)
        >>> uv = model.transform(points)                  # (2000, 2)
        >>> cut = points[model.seams()]                   # the points where the surface is open

    Attributes:
        preset: "paper", the training as the text gives it, or "learned", ours;
            `parapoint.learned.presets` has every number of each. Of the parameters below None
            takes the preset's value.
        points: training points.
        iterations: steps, the warm-up included.
        time_budget: seconds of work (`parapoint.clock`); the schedule follows the time where that
            ends sooner, and steps take as many points as leave enough of them on this machine.
        subset: points of a step before the last phase, which takes all.
        all_from: share of the run after which steps take all points.
        warm_up: share of the run that goes to the convex hull.
        optimizer: "soap", or "adamw", the choice of the paper's group.
        distortion: "conformal" or "isometric".
        distortion_weight: its weight; the paper's text has 1e-4 for complex shapes.
        unwrap_weight, cycle_weight, anti_flip_weight: of these terms; 0 leaves one out.
        eigenvalues: "singular" or "gram", the readings of "the eigenvalues of the Jacobian".
        branches: "both", or an ablation: "3d" (3D→2D→3D alone) or "2d" (2D→3D→2D alone).
        start: "hull", the points' convex hull, or "computed", a map that the networks are taught;
            where none can be computed the hull takes its place.
        components: see `Estimator`.
        seed: of every random draw.
        device: "auto", "cpu" or "cuda".
        threads: of the processor, None as torch has it.
    """

    packages: ClassVar[tuple[str, ...]] = ("torch", "libigl", "scipy", "shapely")

    preset: str = "learned"
    points: int | None = None
    iterations: int | None = None
    time_budget: float | None = None
    subset: int | None = None
    all_from: float | None = None
    warm_up: float | None = None
    optimizer: str | None = None
    distortion: str | None = None
    distortion_weight: float | None = None
    unwrap_weight: float | None = None
    cycle_weight: float | None = None
    anti_flip_weight: float | None = None
    eigenvalues: str | None = None
    branches: str | None = None
    start: str | None = None
    components: str = "together"
    seed: int = 0
    device: str = "auto"
    threads: int | None = None

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: not where time ends the fit, nor on CUDA."""
        return self.time_budget is None and device_of(self.device) == "cpu"

    def check(self) -> None:
        """See `Estimator`."""
        super().check()
        self.numbers()
        if self.device != "auto":
            device_of(self.device)
        if self.threads is not None:
            check_whole("threads", self.threads, 1, MOST_THREADS)

    def numbers(self, start: str | None = None) -> Preset:
        """The preset with this estimator's parameters in it, or with another start.

        Raises:
            InputError: there is no such preset, or a parameter is not as said.
        """
        start = start or self.start
        preset = presets.named(self.preset, start)
        own = {field.name for field in dataclasses.fields(Preset)}
        given = {k: v for k, v in self.get_params().items() if k in own and v is not None}
        return dataclasses.replace(preset, **given | ({"start": start} if start else {}))

    def fit_part(self, surface: Surface, share: float, session: Session) -> Fitted:
        """See `parapoint.fitting.Strategy`.

        Raises:
            DivergedError: the training diverged, and again with a smaller step.
        """
        from parapoint.learned.trained_map import TrainedMap, threads

        begun = clock.worked()
        preset = self.numbers()
        count = max(FEWEST_POINTS, round(preset.points * share))
        budget = None if self.time_budget is None else self.time_budget * share
        if preset.start == "computed" and budget is not None:
            count = min(count, max(FEWEST_POINTS, round(STARTED_PER_SECOND * budget)))
        preset = dataclasses.replace(preset, points=count)
        points = training_points(surface, count, self.seed)
        frame = Frame.of(points)
        with threads(self.threads):
            trainer, found = self._trainer(frame.inside(points), preset, budget, session)
            trace = self._trained(trainer, frame, points, session, begun)
        if trainer.divergences:
            logger.warning("training diverged once and went on with a smaller step")
        map_ = TrainedMap(trainer.networks, trainer.preset, self.threads)
        normals = oriented_normals(frame.inside(points))
        side = 1 if are_outer(surface, points, normals) else -1
        map_ = map_.seen_from(frame.inside(points), side * normals)
        if map_.is_mirrored:
            trace = tuple(
                of._replace(uv=None if of.uv is None else of.uv * [-1, 1]) for of in trace
            )
        return Fitted(map_, frame, points, trace, self._report(trainer, trace) | found)

    def _trainer(
        self, cloud: FloatArray, preset: Preset, budget: float | None, session: Session
    ) -> tuple[Trainer, dict[str, object]]:
        """A trainer of points in the frame with its start, and what the report says of the start.

        Where no map can be computed the hull is the start.
        """
        from parapoint.computed.reconstruction import ReconstructionError
        from parapoint.learned.start import computed_start
        from parapoint.learned.taught import TaughtTrainer
        from parapoint.learned.trainer import Trainer

        device = device_of(self.device)
        found: dict[str, object] = {"start": preset.start}
        if preset.start == "computed":
            session.tell(Progress("computing a start"))
            deadline = math.inf if budget is None else clock.worked() + STARTING * budget
            try:
                start = computed_start(without_coincident(cloud), preset.gates, deadline)
            except ReconstructionError as error:
                logger.warning("no map could be computed, so the hull is the start: %s", error)
                found = {"start": "hull", "start_not_computed": str(error)}
            else:
                taught = TaughtTrainer(
                    start, preset, seed=self.seed, device=device, time_budget=budget
                )
                return taught, found
        hull = dataclasses.replace(self.numbers("hull"), points=preset.points)
        trainer = Trainer(cloud, hull, seed=self.seed, device=device, time_budget=budget)
        return trainer, found

    def _trained(
        self,
        trainer: Trainer,
        frame: Frame,
        points: FloatArray,
        session: Session,
        begun: float,
    ) -> tuple[TracePoint, ...]:
        """Train to the end; the trace has the losses, and maps of the points that are watched."""
        from parapoint.learned.checkpoint import Checkpoint, identity
        from parapoint.learned.trained_map import TrainedMap

        trace: tuple[TracePoint, ...] = ()
        checkpoint = None
        if session.checkpoint is not None:
            settings = [trainer.preset.facts(), self.seed, trainer.time_budget]
            checkpoint = Checkpoint(session.checkpoint, identity(settings, points))
            if (state := checkpoint.read()) is not None:
                trainer.resume(state[0], state[1]["trainer"])
                trace = tuple(TracePoint(*row) for row in state[1]["trace"])
        trainer.seconds += clock.worked() - begun
        remaining = _remaining(trainer)
        for step in trainer.run():
            if step.losses:
                kept = sum(point.uv is not None for point in trace)
                is_due = step.progress * KEPT_MAPS >= kept + 1
                uv = None
                if session.watched is not None and is_due:
                    now = TrainedMap(trainer.networks, trainer.preset)
                    uv = now.flatten(frame.inside(session.watched)) * frame.scale
                trace = (*trace, TracePoint(step.iteration, step.seconds, step.losses, uv))
            if checkpoint is not None:
                checkpoint.write_each_minute(trainer, trace)
            session.tell(
                Progress(step.phase, step.progress, remaining(step), step.iteration, step.losses)
            )
        if checkpoint is not None:
            checkpoint.remove()
        return trace

    def _report(self, trainer: Trainer, trace: tuple[TracePoint, ...]) -> dict[str, object]:
        import torch

        preset = trainer.preset
        used = len(trainer.shape.points)
        return {
            "preset": self.preset,
            "points": used,
            "points_of_a_step": min(trainer.subset, used),
            "iterations": trainer.iteration,
            "optimizer": preset.optimizer,
            "starts": trainer.starts,
            "warm_up": preset.warm_up,
            "weights": trainer.weights,
            "distortion": preset.distortion,
            "eigenvalues": preset.eigenvalues,
            "branches": preset.branches,
            "losses": dict(trace[-1].values) if trace else {},
            "divergences": trainer.divergences,
            "seconds": round(trainer.seconds, 3),
            "processor_seconds": round(trainer.processor_seconds, 3),
            "device": trainer.device,
            "threads": self.threads or torch.get_num_threads(),
        }


def _remaining(trainer: Trainer) -> Callable[[Step], float]:
    """Seconds to the end of a run after a step, at the pace from now on."""
    iteration, seconds = trainer.iteration, trainer.seconds

    def remaining(step: Step) -> float:
        pace = (step.seconds - seconds) / (step.iteration - iteration)
        left = pace * (trainer.preset.iterations - step.iteration)
        return (
            left if trainer.time_budget is None else min(left, trainer.time_budget - step.seconds)
        )

    return remaining
