"""What the trainings of the neural rivals share."""

from __future__ import annotations

import torch

from parapoint.learned.networks import SurfaceNetworks
from parapoint.learned.presets import Preset
from parapoint.learned.trainer import Trainer
from parapoint.surfaces.surface import FloatArray


class SurfaceTrainer(Trainer):
    """A trainer of other networks on an oriented cloud; a rival is a subclass.

    Args:
        points: (N, 3), centred, largest norm 1.
        normals: (N, 3), or None where the surface has none.
        preset: the schedule.
        seed: of all random draws.
        time_budget: seconds.
    """

    def __init__(
        self,
        points: FloatArray,
        normals: FloatArray | None,
        preset: Preset,
        *,
        seed: int,
        time_budget: float | None,
    ) -> None:
        self.normals = normals
        super().__init__(
            points,
            preset,
            seed=seed,
            device="cuda" if torch.cuda.is_available() else "cpu",
            time_budget=time_budget,
            networks=self.new_networks(torch.Generator().manual_seed(seed)),
        )

    def new_networks(self, generator: torch.Generator) -> SurfaceNetworks:
        """Networks to train, their weights drawn from `generator`."""
        raise NotImplementedError
