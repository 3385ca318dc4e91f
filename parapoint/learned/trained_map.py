"""The map that trained networks make, as the rest of the library sees it: arrays in, arrays out."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from parapoint.errors import InputError
from parapoint.learned.devices import device_of
from parapoint.learned.features import FeatureNetworks
from parapoint.learned.networks import ACTIVATIONS, Networks, SubNetworks, SurfaceNetworks
from parapoint.learned.presets import Preset
from parapoint.parameters import MOST_THREADS, check_whole
from parapoint.surfaces.surface import FloatArray

SEEN = 2_000
"""Points at which a map is asked from which side it is seen."""
BATCH = {"cpu": 2_048, "cuda": 65_536}
"""Points that go through the networks at a time: on a CPU their layers stay in its cache."""


@dataclass(frozen=True, eq=False)
class TrainedMap:
    """The five trained networks as a `SurfaceMap`.

    Attributes:
        networks: Deform, Cut, Stitch, Wrap and Unwrap.
        preset: the numbers of the run; the sizes of the networks are among them.
        threads: processor threads that torch may use, None for as many as it uses anyway.
        is_mirrored: whether u is turned round, so that the outer side of the surface lies upwards.
    """

    networks: SurfaceNetworks
    preset: Preset
    threads: int | None = None
    is_mirrored: bool = False

    def flatten(self, points: FloatArray) -> FloatArray:
        """See `SurfaceMap`: Unwrap(Cut(P))."""
        return self._sides() * self._mapped(points, 2, self.networks.parameterization)

    def lift(self, uv: FloatArray) -> FloatArray:
        """See `SurfaceMap`: Stitch(Wrap(Q))."""
        return self._mapped(self._sides() * uv, 3, self.networks.surface)

    def seen_from(self, points: FloatArray, normals: FloatArray) -> TrainedMap:
        """The map as seen from the side of (N, 3) normals at points, of which some are looked at.

        The gradients ∇u × ∇v of a map point to the side from which it is seen.
        """
        rows = slice(None, None, -(-len(points) // SEEN))
        device = next(self.networks.parameters()).device
        x = torch.from_numpy(points[rows]).float().to(device).requires_grad_()
        with torch.enable_grad(), threads(self.threads):
            uv = self.networks.parameterization(x)
            (of_u,) = torch.autograd.grad(uv[:, 0].sum(), x, retain_graph=True)
            (of_v,) = torch.autograd.grad(uv[:, 1].sum(), x)
        up = torch.linalg.cross(of_u, of_v).cpu().numpy()
        agree = np.sign((up * normals[rows]).sum(axis=1)).sum()
        return dataclasses.replace(self, is_mirrored=bool(agree < 0))

    def _sides(self) -> FloatArray:
        return np.array([-1.0 if self.is_mirrored else 1.0, 1.0])

    def _mapped(
        self, values: FloatArray, columns: int, networks: Callable[[Tensor], Tensor]
    ) -> FloatArray:
        mapped = np.empty((len(values), columns))
        device = next(self.networks.parameters()).device
        batch = BATCH[device.type]
        with torch.no_grad(), threads(self.threads):
            for begin in range(0, len(values), batch):
                rows = slice(begin, begin + batch)
                x = torch.from_numpy(values[rows]).float().to(device)
                mapped[rows] = networks(x).cpu().numpy()
        return mapped

    def arrays(self) -> dict[str, np.ndarray]:
        """See `SurfaceMap`."""
        return {name: of.cpu().numpy() for name, of in self.networks.state_dict().items()}

    def charted(self) -> None:
        """See `SurfaceMap`."""

    def facts(self) -> dict[str, Any]:
        """See `SurfaceMap`."""
        return {
            "preset": self.preset.facts(),
            "threads": self.threads,
            "is_mirrored": self.is_mirrored,
        }

    @classmethod
    def restored(cls, arrays: dict[str, np.ndarray], facts: dict[str, Any], device: str) -> Self:
        """The map that `arrays` and `facts` returned, on a device.

        Raises:
            InputError: the device or a number of the preset is not as it has to be.
            RuntimeError: the arrays do not fit the networks of the preset.
        """
        preset = Preset.from_facts(facts["preset"])
        most = max(array.size for array in arrays.values())
        if preset.largest_layer() > most:  # before memory is taken for networks of a false size
            raise InputError("the sizes of the networks do not fit the saved arrays")
        networks = new_networks(preset, torch.Generator())
        networks.load_state_dict({n: torch.tensor(array) for n, array in arrays.items()})
        is_mirrored = facts.get("is_mirrored", False) is True  # models of older versions have none
        if (count := facts.get("threads")) is not None:
            check_whole("threads", count, 1, MOST_THREADS)
        return cls(networks.to(device_of(device)), preset, count, is_mirrored)


def new_networks(preset: Preset, generator: torch.Generator) -> SubNetworks:
    """Networks of a preset with random weights."""
    sizes = preset.hidden, preset.embedding
    activation = ACTIVATIONS[preset.activation]
    if preset.features:
        of = preset.features, preset.gates
        return FeatureNetworks(*sizes, *of, activation=activation, generator=generator)
    return Networks(*sizes, activation, generator)


@contextmanager
def threads(count: int | None) -> Iterator[None]:
    """Torch on this many threads, and as before afterwards."""
    before = torch.get_num_threads()
    torch.set_num_threads(count or before)
    try:
        yield
    finally:
        torch.set_num_threads(before)
