"""Training: the hull warm-up, the schedule, the loop, divergence, the state that is saved."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from parapoint import clock
from parapoint.learned import losses
from parapoint.learned.batches import Cloud, lattice
from parapoint.learned.networks import Cycle, SubNetworks, SurfaceNetworks
from parapoint.learned.optimizers import OPTIMIZERS
from parapoint.learned.presets import Preset
from parapoint.learned.trained_map import new_networks
from parapoint.surfaces.normals import tangent_frames
from parapoint.surfaces.sampling import hull_sample, mean_spacing
from parapoint.surfaces.surface import FloatArray

SNAPSHOTS = 100
"""States kept in a run, evenly: the last good one is where a diverged run begins again."""
DIVERGED = 10.0
"""A mean loss this many times the phase's lowest has diverged."""
SHORT = 256
"""Points of a step where a time budget allows no more."""
TIMED = range(3, 8)
"""Steps of SHORT points that are timed; the steps before them set up what later ones use."""
DENSER = 4
"""Where steps of all points would exceed a time budget, later steps compare the cloud with a
lattice of this many times the points of a step. A coarser one draws both sides of a finger
inwards."""
ENOUGH_STEPS = 5_000
"""A time budget that allows more steps of SHORT points than these gives larger ones in place."""
SMALLER_STEP = 0.3
"""Factor on the learning rate after a divergence."""
LAST_RATE = 0.01
"""The last learning rate over the first; a cosine leads from one to the other."""
LARGEST_KEPT = 31 * 2**20
"""Bytes of the largest block by whose release glibc learns to keep freed memory: under 32 MiB."""


class DivergedError(RuntimeError):
    """Training diverged twice, the second time with a smaller step, before any usable state."""


class Step(NamedTuple):
    """Where a run is.

    Attributes:
        iteration: steps done.
        progress: share of the run that is done, in [0, 1].
        seconds: time spent in training, earlier sessions of a resumed run included.
        phase: "hull", "subset" or "all".
        losses: at a snapshot, the mean of each unweighted term and of the weighted "total" since
            the one before; empty at other steps.
    """

    iteration: int
    progress: float
    seconds: float
    phase: str
    losses: dict[str, float]


_FACTS = (
    "iteration",
    "seconds",
    "processor_seconds",
    "subset",
    "_timed",
    "divergences",
    "_phase_now",
    "_start",
    "_lowest",
    "_last",
    "_lowest_start",
    "_next_snapshot",
    "_sums",
    "_count",
)
"""Attributes of a Trainer that a checkpoint keeps."""


def _under(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix`, without it."""
    return {name[len(prefix) :]: t for name, t in tensors.items() if name.startswith(prefix)}


class Trainer:
    """Fits the networks to one cloud. Another objective is a subclass with its own `terms`.

    Args:
        points: (N, 3) float32, centred, largest norm 1.
        preset: every number of the run.
        seed: of all random draws: initial weights, subsets, perturbations.
        device: "cpu" or "cuda".
        time_budget: seconds of work after which the run ends; the schedule follows them where they
            end before the preset's number of iterations, and the points of a step are as many as
            leave ENOUGH_STEPS on this machine, from SHORT up to the preset's.
        networks: what to train, all its parameters; new networks of the preset by default, which
            may have several starts.

    Attributes:
        seconds: spent so far; what was spent before the run may be added, as part of the budget.
        processor_seconds: time of the processor that went to the steps, all threads together.
        subset: points of a step before the last phase.
    """

    def __init__(
        self,
        points: FloatArray,
        preset: Preset,
        *,
        seed: int,
        device: str,
        time_budget: float | None = None,
        networks: SurfaceNetworks | None = None,
    ) -> None:
        keep_freed_memory()
        self.preset, self.time_budget = preset, time_budget
        self.generator = torch.Generator().manual_seed(seed)
        self.starts = preset.starts if networks is None else 1
        self.networks = (self._new_networks() if networks is None else networks).to(device)
        parameters: list[Tensor] = [p for p in self.networks.parameters() if p.requires_grad]
        self.optimizer = OPTIMIZERS[preset.optimizer](parameters)
        self.device = device
        self.shape = self.hull = Cloud(self.prepared(points), preset.patch)
        if preset.warm_up:
            hull = hull_sample(points, len(points), seed)
            self.hull = Cloud(self.prepared(hull), preset.patch)
        self.noise = preset.perturbation * mean_spacing(points)
        self.iteration = 0
        self.seconds = self.processor_seconds = 0.0
        self.subset = preset.subset if time_budget is None else min(SHORT, preset.subset)
        self._timed: list[float] = []
        self.divergences = 0
        self._phase_now = ""
        self._start = 0
        self._lowest = self._last = self._lowest_start = math.inf
        self._best_start: dict[str, Tensor] = {}
        self._next_snapshot = 1 / SNAPSHOTS
        self._sums: dict[str, float] = {}
        self._count = 0
        self._good = deepcopy(self._state())

    @property
    def weights(self) -> dict[str, float]:
        """The weight of each term of the objective."""
        names = ("unwrap", "wrap", "cycle", "distortion", "anti_flip", "unfolding")
        given = {name: float(getattr(self.preset, f"{name}_weight")) for name in names}
        return {name: weight for name, weight in given.items() if weight or name != "unfolding"}

    def prepared(self, points: FloatArray) -> Tensor:
        """(1, N, 3) points, or (3, N, 3) with their tangent frames where a term asks for these."""
        rows = points[None]
        if self.preset.unfolding_weight:
            rows = np.concatenate([rows, tangent_frames(points)])
        return torch.as_tensor(rows, dtype=torch.float32, device=self.device)

    def terms(self, points: Tensor, grid: Tensor, given: Tensor) -> dict[str, Tensor]:
        """The unweighted terms of the objective at a batch.

        Args:
            points: rows of `prepared`, some of the N points.
            grid: (M, 2) a lattice in [−1, 1]².
            given: (N, 3) all points.
        """
        cycle = self.networks(
            points if self.preset.branches != "2d" else None,
            grid if self.preset.branches != "3d" else None,
        )
        return objective_terms(self.preset, cycle, given, self._dense_surface())

    @property
    def progress(self) -> float:
        """Share of the run that is done, by iterations or by time, whichever is ahead."""
        by_time = 0.0 if self.time_budget is None else self.seconds / self.time_budget
        return min(1.0, max(self.iteration / self.preset.iterations, by_time))

    @property
    def schedule(self) -> float:
        """Where the schedule is, in [0, 1]: as `progress`, but each start begins it anew."""
        share, others = self.preset.start_share, self.starts - 1
        return (self.progress - share * min(self._start, others)) / (1 - share * others)

    def run(self) -> Iterator[Step]:
        """Train to the end, a `Step` for each iteration; leave the networks at the best state.

        Of several starts the one whose last mean loss is lowest goes on.

        Best: the lowest mean loss between two snapshots of the last phase (losses of different
        phases do not compare: the Chamfer distance falls with the number of points).

        Raises:
            DivergedError: the loss blew up twice.
        """
        longest = 0.0
        begin, processor = clock.worked(), time.process_time()
        while self.progress < 1 and self._fits(longest):
            phase = self._phase()
            if phase != self._phase_now:
                self._phase_now, self._lowest, longest = phase, math.inf, 0.0
                self._sums, self._count = {}, 0
            for name, value in self._step().items():
                self._sums[name] = self._sums.get(name, 0.0) + value
            self._count += 1
            self.iteration += 1
            now, processor_now = clock.worked(), time.process_time()
            longest = max(longest, now - begin)
            self.seconds += now - begin  # what is done between steps counts too
            self.processor_seconds += processor_now - processor
            if self.time_budget is not None and self.iteration in TIMED:
                self._timed.append(now - begin)
                self._choose_subset(self.time_budget)
            begin, processor = now, processor_now
            means: dict[str, float] = {}
            ends_phase = self.progress == 1 or self._phase() != phase or self._start_ends()
            if ends_phase or self.progress >= self._next_snapshot:
                means = {name: total / self._count for name, total in self._sums.items()}
                self._snapshot(means["total"])
            if self._start_ends():
                self._next_start()
            yield Step(self.iteration, self.progress, self.seconds, phase, means)
        self._restore(self._good)

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint holds as tensors: this state, the last good one, the generator."""
        kept = {"now": self._state(), "good": self._good, "start": self._best_start}
        return {
            "generator": self.generator.get_state(),
            **{f"{key}.{name}": t for key, state in kept.items() for name, t in state.items()},
        }

    def facts(self) -> dict[str, Any]:
        """What a checkpoint holds as JSON."""
        return {name: getattr(self, name) for name in _FACTS}

    def resume(self, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
        """Go on from what `tensors` and `facts` returned in an earlier process."""
        self.generator.set_state(tensors["generator"])
        self._restore(_under("now.", tensors))
        self._good = _under("good.", tensors)
        self._best_start = _under("start.", tensors)
        for name in _FACTS:
            setattr(self, name, facts[name])

    def _new_networks(self) -> SubNetworks:
        return new_networks(self.preset, self.generator)

    def _choose_subset(self, budget: float) -> None:
        """Once the first steps are timed, take as many points as leave enough steps."""
        if self.iteration == TIMED[-1]:
            steps = (budget - self.seconds) / float(np.median(self._timed))
            affordable = round(SHORT * max(1.0, steps / ENOUGH_STEPS))
            self.subset = min(affordable, self.preset.subset)

    def _start_ends(self) -> bool:
        """Whether one of several starts is done."""
        share = self.preset.start_share
        return 1 < self.starts > self._start and round(self.progress / share, 9) >= self._start + 1

    def _next_start(self) -> None:
        """Begin the next start; after the last one go on with the best."""
        if self._last < self._lowest_start:
            self._lowest_start, self._best_start = self._last, deepcopy(self._state())
        self._start += 1
        if self._start < self.starts:
            self.networks.load_state_dict(self._new_networks().state_dict())
            begun = {name: torch.zeros_like(t) for name, t in self.optimizer.state().items()}
            self.optimizer.restore(begun)
        else:
            self._restore(self._best_start)
        self._phase_now, self._good = "", deepcopy(self._state())

    def _state(self) -> dict[str, Tensor]:
        """Weights and optimiser state by name, not copied."""
        kept = {"networks": self.networks.state_dict(), "optimizer": self.optimizer.state()}
        return {f"{key}.{name}": t for key, state in kept.items() for name, t in state.items()}

    def _restore(self, state: dict[str, Tensor]) -> None:
        """Load a copy of what `_state` returned."""
        self.networks.load_state_dict(_under("networks.", state))
        self.optimizer.restore(_under("optimizer.", state))

    def _snapshot(self, total: float) -> None:
        """Keep the state if its mean loss is the phase's lowest; go back to it if it diverged.

        A loss that merely rises is let rise: the run ends with the best state anyhow.
        """
        self._next_snapshot = self.progress + 1 / SNAPSHOTS
        self._last = total
        self._sums, self._count = {}, 0
        if math.isfinite(total) and total <= DIVERGED * self._lowest:
            if total < self._lowest:
                self._lowest = total
                self._good = deepcopy(self._state())
            return
        self.divergences += 1
        self._restore(self._good)
        if self.divergences > 1:
            raise DivergedError("training diverged twice, the second time with a smaller step")

    def _fits(self, seconds: float) -> bool:
        """Whether a step of this length still ends within the time budget."""
        return self.time_budget is None or self.seconds + seconds <= self.time_budget

    def _phase(self) -> str:
        if self.schedule < self.preset.warm_up:
            return "hull"
        return "subset" if self.schedule < self.preset.all_from else "all"

    def _step(self) -> dict[str, float]:
        """One iteration: its unweighted terms and the weighted total."""
        try:
            terms = self.terms(*self._batch(), self._cloud().points)
        except losses.NotFiniteError:
            return {"total": math.nan}
        total = torch.stack([self.weights[name] * value for name, value in terms.items()]).sum()
        total.backward()  # type: ignore[no-untyped-call]
        self.optimizer.step(self._learning_rate())
        return {name: value.item() for name, value in {**terms, "total": total}.items()}

    def _learning_rate(self) -> float:
        first = self.preset.learning_rate or self.optimizer.learning_rate
        cosine = (1 + math.cos(math.pi * self.schedule)) / 2
        return first * (LAST_RATE + (1 - LAST_RATE) * cosine) * SMALLER_STEP**self.divergences

    def _batch(self) -> tuple[Tensor, Tensor]:
        """Perturbed points of the phase (see `prepared`) and a perturbed lattice (about n, 2)."""
        cloud = self._cloud()
        takes_all = self._phase() == "all" and self.time_budget is None
        size = len(cloud.points) if takes_all else self.subset
        rows = cloud.drawn(size, self.generator)
        size = rows.shape[1]
        noise = torch.zeros(rows.shape)
        noise[0] = self.noise * torch.randn(size, 3, generator=self.generator)
        grid = lattice(round(math.sqrt(size)), self.generator)
        return rows + noise.to(self.device), grid.to(self.device)

    def _dense_surface(self) -> Tensor | None:
        """(DENSER · M, 3) P̂ of a lattice for the Chamfer distance alone, where one is due."""
        is_due = self._phase() == "all" and self.time_budget is not None
        if not is_due or self.preset.branches == "3d":
            return None
        networks = self.networks
        assert isinstance(networks, SubNetworks)
        grid = lattice(round(math.sqrt(DENSER * self.subset)), self.generator).to(self.device)
        return networks.surface(networks.deform(grid[None])[0])

    def _cloud(self) -> Cloud:
        """What the phase is fitted to."""
        return self.hull if self._phase() == "hull" else self.shape


def objective_terms(
    preset: Preset, cycle: Cycle, points: Tensor, made: Tensor | None = None
) -> dict[str, Tensor]:
    """The unweighted terms of the objective; those of a branch that is left out are missing.

    Args:
        preset: weights and settings.
        cycle: both branches.
        points: (N, 3) all given points. P̂ is held against these also where a sparse subset goes
            through the networks: against the subset alone the Chamfer distance is mostly sampling
            noise, in which the terms of weight 0.01 drown.
        made: (M, 3) what is held against them, the grid branch's own P̂ by default.
    """
    distortion = losses.DISTORTIONS[preset.distortion]
    eigenvalues = losses.EIGENVALUES[preset.eigenvalues]
    terms: dict[str, Tensor] = {}
    cycle_terms, tangents_at = [], []
    if cycle.point is not None:
        there = cycle.point
        terms["unwrap"] = losses.unwrap_loss(
            there.uv, preset.unwrap_neighbours, preset.unwrap_spacing
        )
        cycle_terms += [(there.points, there.points_cycle), (there.cut, there.cut_cycle)]
        tangents_at.append((there.points_cycle, there.tangents))
        if len(there.unfolding):
            terms["unfolding"] = losses.unfolding_loss(there.unfolding, preset.area_weight)
    if cycle.grid is not None:
        back = cycle.grid
        terms["wrap"] = losses.wrap_loss(back.points if made is None else made, points)
        cycle_terms += [(back.uv, back.uv_cycle), (back.cut, back.cut_cycle)]
        tangents_at.append((back.points, back.tangents))
    K, T = preset.anti_flip_neighbours, preset.anti_flip_angle
    return {
        **terms,
        "cycle": _sum([losses.cycle_loss(*pair) for pair in cycle_terms]),
        "distortion": _sum([distortion(*eigenvalues(J)) for _, J in tangents_at]),
        "anti_flip": _sum([losses.anti_flip_loss(p, J, K, T) for p, J in tangents_at]),
    }


def _sum(terms: list[Tensor]) -> Tensor:
    return torch.stack(terms).sum()


def keep_freed_memory() -> None:
    """Let glibc keep up to 62 MiB of freed memory, so that a step finds that of the step before.

    Twice the largest block that was ever freed is kept (mallopt(3), M_MMAP_THRESHOLD). What is over
    goes back to the system, and comes again by page faults: 6 % of a step of 256 points. The block
    is never written, so it takes no memory; other C libraries see a block come and go.
    """
    torch.empty(LARGEST_KEPT, dtype=torch.uint8)
