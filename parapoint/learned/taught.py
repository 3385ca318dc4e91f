"""Training from a computed start: the paper's objective, and what the start teaches."""

from __future__ import annotations

import dataclasses
import math

import torch
from torch import Tensor, nn

from parapoint import clock
from parapoint.learned import losses
from parapoint.learned.features import FeatureNetworks, GatedCut
from parapoint.learned.optimizers import SOAP
from parapoint.learned.presets import Preset
from parapoint.learned.start import Start
from parapoint.learned.trained_map import new_networks
from parapoint.learned.trainer import Trainer
from parapoint.surfaces.surface import FloatArray

NEAR = 0.01
"""Distance, in radii of the surface, from the start's map that is good already."""
LARGEST_ERROR = 4.0
"""Squared relative error of a Jacobian beyond which more does not count: at seams and folds of the
start it would drown the rest."""
LEAST_STRETCH = 1e-2
"""Squared stretch of the start, below which its Jacobian counts as this large."""


TERMS = ("map", "jacobian", "unfolding", "inverse", "cycle", "wrap")
GATE_STEPS = 1_500
"""Steps of the training of Cut's gates; after 1,000 no point was on the wrong side of a seam."""
GATE_SHARE = 0.06
"""Share of the time budget after which that training ends."""
GATE_POINTS = 384
"""Points of each of its steps."""
SPARSE = 4
"""One point of the lattice in this many goes through the networks: the start covers the surface
already, and Deform follows it."""


class TaughtTrainer(Trainer):
    """A trainer that begins with random networks and teaches them a start as it goes.

    First the gates of Cut learn the sides of the seams. Then all else is trained at once: Cut and
    Unwrap by the start's map, its derivatives along the surface, and the distortion of their own
    map; Wrap and Stitch to bring each point back; Deform to spread the lattice over the surface;
    all by the paper's cycles.

    Args:
        start: what is taught.
        preset: every number of the run; there is no hull.
        seed: see `Trainer`.
        device: see `Trainer`.
        time_budget: see `Trainer`.
    """

    def __init__(
        self,
        start: Start,
        preset: Preset,
        *,
        seed: int,
        device: str,
        time_budget: float | None = None,
    ) -> None:
        self.start = start
        networks = new_networks(preset, torch.Generator().manual_seed(seed)).to(device)
        assert isinstance(networks, FeatureNetworks)
        steps = min(GATE_STEPS, preset.iterations)
        seconds = math.inf if time_budget is None else GATE_SHARE * time_budget
        teach_gates(networks.cut, start, seed, steps, seconds)
        super().__init__(
            start.points,
            dataclasses.replace(preset, warm_up=0.0),
            seed=seed,
            device=device,
            time_budget=time_budget,
            networks=networks,
        )

    @property
    def weights(self) -> dict[str, float]:
        """See `Trainer`."""
        return {name: float(getattr(self.preset, f"{name}_weight")) for name in TERMS}

    def prepared(self, points: FloatArray) -> Tensor:  # noqa: ARG002 (they are the start's)
        """(6, N, 3) rows for each point: itself, its frame, gradients of u and v, offsets."""
        start = self.start
        known = torch.cat(
            [
                torch.as_tensor(start.points)[None],
                torch.as_tensor(start.frames),
                torch.as_tensor(start.gradients),
                nn.functional.pad(torch.as_tensor(start.offsets), (0, 1))[None],
            ]
        )
        return known.to(self.device, torch.float32)

    def terms(
        self,
        points: Tensor,
        grid: Tensor,
        given: Tensor,  # noqa: ARG002 (P̂ is held against the batch)
    ) -> dict[str, Tensor]:
        """See `Trainer`."""
        frames, gradients, offsets = points[1:3], points[3:5], points[5, :, :2]
        cycle = self.networks(points[:3], grid[::SPARSE], slopes=False)
        there, back = cycle.point, cycle.grid
        wanted = torch.einsum("cni,ni->nc", gradients, points[0]) + offsets
        slopes = torch.einsum("cni,tni->tnc", gradients, frames)
        return {
            "map": distance_loss(there.uv, wanted),
            "jacobian": jacobian_loss(there.unfolding, slopes),
            "unfolding": losses.unfolding_loss(there.unfolding, self.preset.area_weight),
            "inverse": (there.points_cycle - there.points).norm(dim=1).mean(),
            "cycle": losses.cycle_loss(there.cut, there.cut_cycle)
            + losses.cycle_loss(back.uv, back.uv_cycle)
            + losses.cycle_loss(back.cut, back.cut_cycle),
            "wrap": losses.wrap_loss(back.points, points[0]),
        }


def distance_loss(made: Tensor, wanted: Tensor) -> Tensor:
    """Mean distance of points (N, 2), squared where it is below NEAR, so that spikes stay small."""
    squared = (made - wanted).square().sum(1)
    return ((squared + NEAR**2).sqrt() - NEAR).mean()


def jacobian_loss(made: Tensor, wanted: Tensor) -> Tensor:
    """Mean squared relative distance, at most LARGEST_ERROR each, of Jacobians (2, N, 2)."""
    size = wanted.square().sum((0, 2)).clamp(min=LEAST_STRETCH)
    error = (made - wanted).square().sum((0, 2)) / size
    return error.clamp(max=LARGEST_ERROR).mean()


def teach_gates(cut: GatedCut, start: Start, seed: int, steps: int, seconds: float) -> None:
    """Train the network of Cut's gates, which is then left as it is.

    Args:
        cut: the network Cut.
        start: what is taught.
        seed: of the draws of points.
        steps: of the training.
        seconds: after which it ends even so.
    """
    parameters = list(cut.gate.parameters())
    device = parameters[0].device
    points, gates = (
        torch.as_tensor(of, dtype=torch.float32, device=device)
        for of in (start.points, start.gates)
    )
    optimizer = SOAP(list(parameters))
    generator = torch.Generator().manual_seed(seed)
    end = clock.worked() + seconds
    for step in range(steps):
        drawn = torch.randint(len(points), (GATE_POINTS,), generator=generator).to(device)
        gate_loss(*cut.sides(points[drawn]), gates[drawn]).backward()  # type: ignore[no-untyped-call]
        optimizer.step(SOAP.learning_rate * (1 - 0.9 * step / steps))
        if clock.worked() > end:
            break
    for parameter in parameters:
        parameter.requires_grad_(False)


def gate_loss(side: Tensor, reach: Tensor, gates: Tensor) -> Tensor:
    """Logistic loss of `side` where there is a seam, squared error of `reach`; all (N, G)."""
    size = gates.abs()
    wrong = size * nn.functional.softplus(-gates.sign() * side)
    return (wrong + (reach - size).square()).sum(1).mean()
