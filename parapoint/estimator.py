"""ParaPoint as a user meets it: fit a surface, map points to the plane and back, find the seams."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import logging
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt
import torch
from scipy.spatial import cKDTree

from parapoint.computed.anchored import AnchoredNetworks, Anchors
from parapoint.computed.flattening import FlatMap, flat_map
from parapoint.computed.reconstruction import ReconstructionError
from parapoint.errors import InputError
from parapoint.learned import presets, saving
from parapoint.learned.charts import Chart, Charts
from parapoint.learned.losses import DISTORTIONS, EIGENVALUES
from parapoint.learned.networks import ACTIVATIONS, Networks, SubNetworks, SurfaceNetworks
from parapoint.learned.presets import SMOOTH, Preset
from parapoint.learned.trainer import DivergedError, Step, Trainer
from parapoint.surfaces.components import components
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.sampling import FEWEST_POINTS, rows_left_out, training_points
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud, Surface

logger = logging.getLogger("parapoint")

BATCH = {"cpu": 2_048, "cuda": 65_536}
"""Points mapped at a time: on a CPU the layers of so many stay in its cache."""
TRIAL_PER_SECOND = 50
"""Points of the first map for each second of the budget: it takes a twentieth of this at the 1,000
points a second of one core, and is what there is where the machine is busy."""
PLANNED = 0.55
"""Share of the time left in which the second map would be done at the speed of the first. Three
times as many points took 0.8 to 1.6 times as long each on seven models."""
DESCENDING = 0.8
"""Share of the budget after which a computed map is improved no more."""
COINCIDENT = 1e-6
"""Points of a computed map that agree to this, in radii of the cloud, count as one."""
KEPT_MAPS = 8
"""Maps kept in the trace of `parameterize`."""
MOST_KEPT_ROWS = 50_000
"""No maps are kept of surfaces with more points."""


class Progress(NamedTuple):
    """What a callback of `ParaPoint.fit` gets after each step.

    Attributes:
        step: where the run is.
        remaining: seconds to the end, as far as can be told.
    """

    step: Step
    remaining: float


@dataclass
class ParaPoint:
    """Global, free-boundary UV maps of point clouds, learned for each (Zhang, Hou and He, 2024).

    Follows scikit-learn: fields are parameters, None takes the preset's value, and what `fit`
    learns ends in an underscore. Also a `Method`: `parameterize` fits and maps a surface.

        >>> import numpy as np
        >>> from parapoint import ParaPoint
        >>> points = np.random.default_rng(0).normal(size=(2000, 3))
        >>> points /= np.linalg.norm(points, axis=1, keepdims=True)
        >>> model = ParaPoint(preset="paper", iterations=500).fit(points)
        >>> uv = model.transform(points)                  # (2000, 2)
        >>> cut = points[model.seams()]                   # the points where the surface is open

    Attributes:
        preset: "paper", "fast" or "smooth"; `parapoint.learned.presets` has every number of each.
            With "fast" the map is computed and held by the networks; only Deform is trained.
        points: training points.
        iterations: steps, the warm-up included.
        time_budget: seconds of fitting; the schedule follows the time where that ends sooner, and
            a computed map is of as many points as the machine, as busy as it is, allows.
        subset: points of a step before the last phase, which takes all.
        all_from: share of the run after which steps take all points.
        distortion: "conformal" or "isometric".
        distortion_weight: its weight; the paper's text has 1e-4 for complex shapes.
        eigenvalues: "singular" or "gram", the readings of "the eigenvalues of the Jacobian".
        warm_up: share of the run that goes to the convex hull.
        branches: "both", or an ablation: "3d" (3D→2D→3D alone) or "2d" (2D→3D→2D alone).
        components: "together", one map for the whole surface; "each", one for each component
            (`parapoint.surfaces.components` says what that is), side by side in the plane; or
            "largest", whose map then holds for all points.
        seed: of every random draw.
        device: "auto", "cpu" or "cuda".
        threads: of the processor, None as torch has it.
        preset_: the numbers of the run, a `Preset`; those of "smooth" where a map could not be
            computed for "fast".
        points_: (n, 3) training points.
        charts_: what the networks of each component are, empty where there is one map.
        networks_: the trained networks.
        centre_, scale_: the points minus `centre_`, over `scale_`, are what the networks see.
        trace_: losses over the run.
        report_: settings, final losses, time and device of the run, rows left out.
    """

    requires: ClassVar[frozenset[str]] = frozenset()
    packages: ClassVar[tuple[str, ...]] = ("torch",)

    preset: str = "fast"
    points: int | None = None
    iterations: int | None = None
    time_budget: float | None = None
    subset: int | None = None
    all_from: float | None = None
    warm_up: float | None = None
    distortion: str | None = None
    distortion_weight: float | None = None
    eigenvalues: str | None = None
    branches: str | None = None
    components: str = "together"
    seed: int = 0
    device: str = "auto"
    threads: int | None = None

    @property
    def deterministic(self) -> bool:
        """Whether the same seed gives the same map: not where time ends the fit, nor on CUDA."""
        return self.time_budget is None and _device(self.device) == "cpu"

    def get_params(self, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002 (scikit-learn's name)
        """The parameters by name."""
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    def set_params(self, **parameters: Any) -> Self:
        """Set parameters by name.

        Raises:
            InputError: there is no such parameter.
        """
        known = self.get_params()
        for name, value in parameters.items():
            if name not in known:
                raise InputError(f"no parameter {name!r}; there are: {', '.join(known)}")
            setattr(self, name, value)
        return self

    def fit(
        self,
        points: npt.ArrayLike | Surface,
        y: None = None,  # noqa: ARG002 (scikit-learn's pipelines pass it)
        *,
        checkpoint: str | Path | None = None,
        callback: Callable[[Progress], None] | None = None,
    ) -> Self:
        """Learn the map of a surface.

        Args:
            points: (N, 3) coordinates, a PointCloud, or a Mesh (its vertices, and points on its
                faces where those do not show its shape). Rows that are not finite are left out,
                repeated ones count once; `report_` has the numbers. Units are free.
            y: not used.
            checkpoint: folder where the state is saved each minute. A fit that finds the state of
                the same run there goes on from it; at the end the state is removed. Not used where
                the map is computed within a time budget, which begins anew.
            callback: called after each step.

        Raises:
            InputError: a parameter is not as said, there are fewer than 100 distinct points, or
                they lie on a line; the checkpoint is of another run or version.
            DivergedError: the training diverged, and again with a smaller step, and there is no
                computed map.
        """
        return self._fit(points, None, checkpoint, callback)

    def transform(self, points: npt.ArrayLike | Surface) -> FloatArray:
        """(N, 2) coordinates in the plane of (N, 3) points on the surface, in the points' unit.

        Any number of points: they are mapped in batches, which bounds the memory.

        Raises:
            InputError: the points have another shape or are not finite, or nothing is fitted.
        """
        self._check_fitted()
        at = _coordinates(points, 3)
        uv: FloatArray = np.empty((len(at), 2))
        with self._mapping() as (batch, device):
            for rows in _slices(len(at), batch):
                x = torch.from_numpy((at[rows] - self.centre_) / self.scale_).float().to(device)
                uv[rows] = self.networks_.parameterization(x).cpu().numpy()
        return uv * self.scale_

    def inverse_transform(self, uv: npt.ArrayLike) -> FloatArray:
        """(N, 3) points on the surface at (N, 2) coordinates of `transform`.

        Raises:
            InputError: the coordinates have another shape or are not finite, or nothing is fitted.
        """
        self._check_fitted()
        at = _coordinates(uv, 2)
        points: FloatArray = np.empty((len(at), 3))
        with self._mapping() as (batch, device):
            for rows in _slices(len(at), batch):
                x = torch.from_numpy(at[rows] / self.scale_).float().to(device)
                points[rows] = self.networks_.surface(x).cpu().numpy()
        return np.asarray(points * self.scale_ + self.centre_)

    def seams(self, points: npt.ArrayLike | Surface | None = None) -> BoolArray:
        """(N,) whether each point lies on a cutting seam (paper, eq. "find-cut").

        It does where one of its K_cut = 3 nearest points in space is farther from it in the plane
        than T_cut = 1 % of the side of the map's square bounding box.

        Args:
            points: (N, 3) points; the training points by default.

        Raises:
            InputError: the points are not as said, fewer than four, or nothing is fitted.
        """
        self._check_fitted()
        at = self.points_ if points is None else _coordinates(points, 3)
        count = self.preset_.seam_neighbours
        if len(at) <= count:
            raise InputError(f"seams need more than {count} points, not {len(at)}")
        uv = self.transform(at)
        near = cKDTree(at).query(at, count + 1, workers=-1)[1][:, 1:]
        apart = np.max([np.linalg.norm(uv - uv[near[:, k]], axis=1) for k in range(count)], axis=0)
        side = np.ptp(uv, axis=0).max()
        return np.asarray(apart > self.preset_.seam_threshold * side)

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """Fit a copy of this model to a surface and map it; see `Method`.

        A mesh gets one uv for each vertex, so faces across a learned seam span it. The trace has
        the losses and some maps along the way.

        Raises:
            InputError: see `fit`.
        """
        model = dataclasses.replace(self, seed=seed)
        vertices = _coordinates(surface, 3)
        watched = vertices if len(vertices) <= MOST_KEPT_ROWS else None
        model._fit(surface, watched, None, None)  # noqa: SLF001 (a copy of this one)
        uv = model.transform(vertices)
        if isinstance(surface, Mesh):
            return Parameterization(uv, surface.faces, model.trace_, model.report_)
        return PointParameterization(uv, model.trace_, model.report_)

    def save(self, folder: str | Path) -> None:
        """Write the fitted model to `folder`: `model.json` and the tensors that it names.

        Raises:
            InputError: nothing is fitted.
        """
        self._check_fitted()
        tensors = {**self.networks_.state_dict(), "fitted": torch.from_numpy(self.points_)}
        facts = {
            "parameters": self.get_params(),
            "preset": dataclasses.asdict(self.preset_),
            "centre": self.centre_.tolist(),
            "scale": self.scale_,
            "report": self.report_,
            "charts": self.charts_,
            "trace": [[t.iteration, t.seconds, dict(t.values)] for t in self.trace_],
        }
        saving.write(Path(folder), "model", tensors, facts)

    @classmethod
    def load(cls, folder: str | Path, *, device: str = "auto") -> Self:
        """The model that `save` wrote to `folder`.

        Raises:
            InputError: there is none, it is damaged, or of another version of the format.
        """
        tensors, facts = saving.read(Path(folder), "model")
        with saving.damage_of(Path(folder)):
            model = cls(**{**facts["parameters"], "device": device})
            model.preset_ = _preset_from(facts["preset"])
            model.points_ = tensors.pop("fitted").numpy()
            model.charts_ = facts["charts"]
            anchors = len(tensors.get("cut.anchors", ()))
            model.networks_ = (
                Charts([_chart(of) for of in model.charts_], len(model.points_))
                if model.charts_
                else _networks(model.preset_, anchors)
            )
            model.networks_.load_state_dict(tensors)
            model.centre_ = np.array(facts["centre"])
            model.scale_ = float(facts["scale"])
            model.report_ = facts["report"]
            model.trace_ = tuple(TracePoint(*row) for row in facts["trace"])
        model.networks_.to(_device(device))
        return model

    def _fit(
        self,
        surface: npt.ArrayLike | Surface,
        watched: FloatArray | None,
        checkpoint: str | Path | None,
        callback: Callable[[Progress], None] | None,
    ) -> Self:
        """`fit`; the trace gets maps of the points `watched`."""
        begun = time.monotonic()
        self.preset_, device = self._checked()
        surface = _surface(surface)
        left_out = rows_left_out(surface)
        if self.components != "together":
            parts = components(surface)
            if self.components == "each" and len(parts) > 1:
                self._fit_each(parts, device, checkpoint, callback)
                self.report_ |= left_out
                return self
            if len(parts) > 1:
                logger.warning("%d components: the largest is fitted", len(parts))
            surface = parts[0]
        with _threads(self.threads):
            if self.preset_.is_computed:
                start, found = self._start(surface, begun)
            else:
                start, found = None, {}
                self._draw(surface, self.preset_.points)
            trainer = Trainer(
                self._framed(),
                self.preset_,
                seed=self.seed,
                device=device,
                time_budget=self.time_budget,
                networks=start,
            )
            self.networks_: SurfaceNetworks = trainer.networks
            self.charts_: list[dict[str, Any]] = []
            self.trace_: tuple[TracePoint, ...] = ()
            store = None
            if checkpoint is not None and (start is None or self.time_budget is None):
                store = saving.Checkpoint(Path(checkpoint), self._identity())
            if store is not None and (state := store.read()) is not None:
                tensors, facts = state
                trainer.resume(tensors, facts["trainer"])
                self.trace_ = tuple(TracePoint(*row) for row in facts["trace"])
            trainer.seconds += time.monotonic() - begun
            remaining = _remaining(trainer)
            begun = time.monotonic() - trainer.seconds
            try:
                for step in trainer.run():
                    if step.losses:
                        self._record(step, watched)
                    if store is not None:
                        store.write_each_minute(trainer, self.trace_)
                    if callback is not None:
                        callback(Progress(step, remaining(step)))
            except DivergedError:
                if start is None:
                    raise
                # Deform alone was trained: the computed map is whole without it.
        if store is not None:
            store.remove()
        self.report_: dict[str, object] = {
            **self._report(trainer, device, time.monotonic() - begun),
            **found,
            **left_out,
        }
        if trainer.divergences:
            times = "once and went on with a smaller step" if trainer.divergences == 1 else "twice"
            logger.warning("training diverged %s", times)
        return self

    def _fit_each(
        self,
        parts: list[Surface],
        device: str,
        checkpoint: str | Path | None,
        callback: Callable[[Progress], None] | None,
    ) -> None:
        """`fit` of each component, with its share of the points and of the time.

        A fit that goes on from a checkpoint begins finished components anew.
        """
        logger.warning("%d components: each is fitted", len(parts))
        sizes = np.array([len(_coordinates(part, 3)) for part in parts])
        models = []
        for k, (part, share) in enumerate(zip(parts, sizes / sizes.sum(), strict=True)):
            budget = None if self.time_budget is None else self.time_budget * float(share)
            count = max(FEWEST_POINTS, round(self.preset_.points * float(share)))
            own = dataclasses.replace(self, components="together", points=count, time_budget=budget)
            folder = None if checkpoint is None else Path(checkpoint) / f"component-{k}"
            models.append(own.fit(part, checkpoint=folder, callback=callback))
            if folder is not None and folder.is_dir():
                folder.rmdir()
        self.points_: FloatArray = np.concatenate([model.points_ for model in models])
        self._frame()
        charts = [
            Chart(m.networks_, m.points_, m.transform(m.points_), m.centre_, m.scale_)
            for m in models
        ]
        joined = Charts([chart.networks for chart in charts], len(self.points_))
        joined.hold(charts, self.centre_, self.scale_)
        self.networks_ = joined.to(device)
        self.charts_ = [
            {"preset": dataclasses.asdict(m.preset_), "anchors": _anchor_count(m.networks_)}
            for m in models
        ]
        self.trace_ = models[0].trace_
        self.report_ = {
            **models[0].report_,
            "points": len(self.points_),
            "components": len(models),
            "iterations": sum(int(str(m.report_["iterations"])) for m in models),
            "seconds": round(sum(float(str(m.report_["seconds"])) for m in models), 3),
        }

    def _frame(self) -> None:
        """`centre_` and `scale_` of `points_`: centre of the box at 0, largest norm 1."""
        self.centre_: FloatArray = (self.points_.min(axis=0) + self.points_.max(axis=0)) / 2
        self.scale_: float = float(np.linalg.norm(self.points_ - self.centre_, axis=1).max())

    def _draw(self, surface: Surface, count: int) -> None:
        """Draw at most `count` training points of the surface."""
        self.points_ = training_points(surface, count, self.seed)
        self._frame()

    def _framed(self) -> FloatArray:
        """(n, 3) the training points as the networks see them."""
        return np.asarray((self.points_ - self.centre_) / self.scale_)

    def _start(
        self, surface: Surface, begun: float
    ) -> tuple[SubNetworks | None, dict[str, object]]:
        """Networks that hold a computed map of the surface, and what the report says of it.

        The map of a noisy point is that of the place on the surface where it belongs.
        Where none can be computed they are None, and `preset_` becomes the one that trains.

        Args:
            surface: what the training points are drawn from.
            begun: when the fit began, by `time.monotonic`.
        """
        budget, count = self.time_budget, self.preset_.points
        deadline = math.inf if budget is None else begun + DESCENDING * budget
        try:
            if budget is None:
                cloud, flat = self._flat_map(surface, count, deadline)
            else:
                few = min(count, max(FEWEST_POINTS, round(TRIAL_PER_SECOND * budget)))
                cloud, flat = self._flat_map_within(surface, few, deadline)
        except ReconstructionError as error:
            logger.warning("no map could be computed, so one is trained: %s", error)
            self.preset_ = self._with_parameters(SMOOTH)
            return None, {"map": "trained", "map_not_computed": str(error)}
        if missing := len(cloud) - len(flat.anchors):
            logger.warning(
                "%d of %d points are not on the surface that was found", missing, len(cloud)
            )
        networks = _networks(self.preset_, len(flat.anchors), self.seed)
        assert isinstance(networks, AnchoredNetworks)
        anchors = Anchors(cloud[flat.anchors], flat.uv, flat.jacobians)
        networks.hold(anchors, flat.inverse_jacobians)
        cut_short = time.monotonic() > deadline
        if cut_short:
            logger.warning(
                "the time was up before the map was at its best; it is of %d points", len(cloud)
            )
        facts = {"map": "computed", "anchors": len(flat.anchors), "found": flat.facts}
        return networks, {**facts, "cut_short": cut_short}

    def _flat_map(
        self, surface: Surface, count: int, deadline: float
    ) -> tuple[FloatArray, FlatMap]:
        """At most `count` training points as the networks see them, none twice, and their map."""
        self._draw(surface, count)
        cloud = self._framed()
        _, rows = np.unique(np.round(cloud / COINCIDENT), axis=0, return_index=True)
        cloud = cloud[np.sort(rows)]
        return cloud, flat_map(cloud, deadline)

    def _flat_map_within(
        self, surface: Surface, few: int, deadline: float
    ) -> tuple[FloatArray, FlatMap]:
        """`_flat_map` of as many points as the time up to `deadline` allows.

        A map of `few` points comes first. It tells how fast this machine is on this surface, and
        it stays where the second one fails, or is cut short and worse.
        """
        before = time.monotonic()
        first: tuple[FloatArray, FlatMap] | None = None
        try:
            first = self._flat_map(surface, few, deadline)
        except ReconstructionError as error:
            fault = error
        now = time.monotonic()
        affordable = round(few * PLANNED * (deadline - now) / (now - before))
        count = min(self.preset_.points, affordable)
        if count > few == len(self.points_):
            try:
                second = self._flat_map(surface, count, deadline)
            except ReconstructionError as error:
                logger.warning("no map of %d points could be computed: %s", count, error)
                fault = error
            else:
                is_whole = time.monotonic() < deadline
                if first is None or is_whole:
                    return second
                # Of two that are as good as exact the one of more points stays.
                if _conformality(second[1]) > _conformality(first[1]) - 1e-6:
                    return second
            self._draw(surface, few)
        if first is None:
            raise fault
        return first

    def _record(self, step: Step, watched: FloatArray | None) -> None:
        """Append a step to the trace, with a map of the points watched where one is due."""
        kept = sum(point.uv is not None for point in self.trace_)
        is_due = watched is not None and step.progress * KEPT_MAPS >= kept + 1
        uv = self.transform(watched) if is_due and watched is not None else None
        point = TracePoint(step.iteration, step.seconds, step.losses, uv)
        self.trace_ = (*self.trace_, point)

    def _report(self, trainer: Trainer, device: str, seconds: float) -> dict[str, object]:
        preset = self.preset_
        return {
            "preset": self.preset,
            "points": len(self.points_),
            "points_of_a_step": min(preset.subset, len(self.points_)),
            "iterations": trainer.iteration,
            "warm_up": preset.warm_up,
            "weights": trainer.weights,
            "distortion": preset.distortion,
            "eigenvalues": preset.eigenvalues,
            "branches": preset.branches,
            "losses": dict(self.trace_[-1].values) if self.trace_ else {},
            "divergences": trainer.divergences,
            "seconds": round(seconds, 3),
            "device": device,
            "threads": self.threads or torch.get_num_threads(),
        }

    def _checked(self) -> tuple[Preset, str]:
        """The preset with this model's parameters in it, and the device.

        Raises:
            InputError: a parameter is not as said.
        """
        preset = presets.named(self.preset)
        for name, least in (
            ("points", FEWEST_POINTS),
            ("iterations", 1),
            ("subset", FEWEST_POINTS),
            ("threads", 1),
        ):
            value = getattr(self, name)
            if value is not None and not (isinstance(value, int) and value >= least):
                raise InputError(f"{name} must be a whole number of at least {least}, not {value}")
        for name, choices in (
            ("distortion", DISTORTIONS),
            ("eigenvalues", EIGENVALUES),
            ("branches", ("both", "3d", "2d")),
            ("components", ("together", "each", "largest")),
        ):
            value = getattr(self, name)
            if value is not None and value not in choices:
                raise InputError(f"{name} must be one of {', '.join(choices)}, not {value!r}")
        if self.time_budget is not None and not 0 < self.time_budget < math.inf:
            raise InputError(f"time_budget must be a number of seconds, not {self.time_budget}")
        for name in ("all_from", "warm_up"):
            value = getattr(self, name)
            if value is not None and not 0 <= value <= 1:
                raise InputError(f"{name} must lie between 0 and 1, not {value}")
        weight = self.distortion_weight
        if weight is not None and not 0 <= weight < math.inf:
            raise InputError(f"distortion_weight must be a number of at least 0, not {weight}")
        if not isinstance(self.seed, int) or self.seed < 0:
            raise InputError(f"seed must be a whole number of at least 0, not {self.seed}")
        return self._with_parameters(preset), _device(self.device)

    def _with_parameters(self, preset: Preset) -> Preset:
        """The preset with this model's parameters in it."""
        own = {field.name for field in dataclasses.fields(Preset)}
        given = {k: v for k, v in self.get_params().items() if k in own and v is not None}
        return dataclasses.replace(preset, **given)

    def _identity(self) -> str:
        """What a checkpoint must agree on with the run that goes on from it."""
        facts = [dataclasses.asdict(self.preset_), self.seed, self.time_budget]
        text = json.dumps(facts).encode() + self.points_.tobytes()
        return hashlib.sha256(text).hexdigest()

    def _check_fitted(self) -> None:
        if not hasattr(self, "networks_"):
            raise InputError("this model is not fitted; call fit or load first")

    @contextmanager
    def _mapping(self) -> Iterator[tuple[int, torch.device]]:
        """No gradients, this model's threads; gives the batch size and the networks' device."""
        device = next(self.networks_.parameters()).device
        with torch.no_grad(), _threads(self.threads):
            yield BATCH[device.type], device


def _coordinates(values: npt.ArrayLike | Surface, columns: int) -> FloatArray:
    """The (N, columns) finite coordinates of a surface or an array."""
    if isinstance(values, Mesh):
        return values.vertices
    if isinstance(values, PointCloud):
        return values.points
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[1] != columns or not np.isfinite(array).all():
        raise InputError(f"coordinates must be finite and of shape (n, {columns})")
    return array


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


def _slices(count: int, batch: int) -> Iterator[slice]:
    return (slice(begin, begin + batch) for begin in range(0, count, batch))


@contextmanager
def _threads(count: int | None) -> Iterator[None]:
    """Torch on this many threads, and as before afterwards."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _device(name: str) -> str:
    """The device of a name: "auto" is CUDA where there is any."""
    if name not in ("auto", "cpu", "cuda"):
        raise InputError(f"device must be auto, cpu or cuda, not {name!r}")
    available = torch.cuda.is_available()
    if name == "cuda" and not available:
        raise InputError("device cuda: none is available; take auto or cpu")
    return "cuda" if available and name != "cpu" else "cpu"


def _networks(preset: Preset, anchors: int, seed: int = 0) -> SubNetworks:
    """Networks of a preset, about to be filled: with saved weights, or a map at the anchors."""
    sizes = preset.hidden, preset.embedding, ACTIVATIONS[preset.activation]
    generator = torch.Generator().manual_seed(seed)
    if preset.is_computed:
        return AnchoredNetworks(anchors, *sizes, generator)
    return Networks(*sizes, generator)


def _anchor_count(networks: SurfaceNetworks) -> int:
    return len(networks.cut.anchors) if isinstance(networks, AnchoredNetworks) else 0


def _chart(facts: dict[str, Any]) -> SurfaceNetworks:
    """Networks of one component, about to be filled with saved weights."""
    return _networks(_preset_from(facts["preset"]), facts["anchors"])


def _surface(given: npt.ArrayLike | Surface) -> Surface:
    """A surface, or the cloud of the finite rows of an array; the number of others is logged."""
    if isinstance(given, Mesh | PointCloud):
        return given
    points = np.asarray(given, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InputError(f"points must have shape (n, 3), not {points.shape}")
    finite = np.isfinite(points).all(axis=1)
    dropped = int((~finite).sum())
    if dropped:
        logger.warning("dropped %d of %d points: not finite", dropped, len(points))
    return PointCloud(points[finite], dropped=dropped)


def _conformality(flat: FlatMap) -> float:
    """Mean ratio of the singular values of the map's Jacobians, 1 where it keeps all angles."""
    values = np.linalg.svd(flat.jacobians, compute_uv=False)
    return float((values[:, 1] / np.maximum(values[:, 0], 1e-300)).mean())


def _preset_from(facts: dict[str, Any]) -> Preset:
    """A preset from JSON, where tuples are lists."""
    return Preset(**{**facts, "hidden": tuple(facts["hidden"])})
