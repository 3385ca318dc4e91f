"""The state of a training on disk, from which a killed fit goes on."""

from __future__ import annotations

import hashlib
import json
import time
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from parapoint import saving
from parapoint.errors import InputError
from parapoint.learned.trainer import Trainer
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.surface import FloatArray

CHECKPOINT_SECONDS = 60.0
"""Seconds between two saved states."""


def identity(settings: list[Any], points: FloatArray) -> str:
    """What a checkpoint must agree on with the run that goes on from it."""
    return hashlib.sha256(json.dumps(settings).encode() + points.tobytes()).hexdigest()


class Checkpoint:
    """The state of a run in a folder, written each minute.

    Args:
        folder: where it is kept.
        run: `identity` of the run.
    """

    def __init__(self, folder: Path, run: str) -> None:
        saving.check_free(folder, "checkpoint")
        self.folder, self.run = folder, run
        self.written = time.monotonic()

    def read(self) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
        """The state of an earlier session of this run, None where there is none.

        Raises:
            InputError: the state is of another run, of another version, or damaged.
        """
        if not (self.folder / "checkpoint.json").is_file():
            return None
        arrays, facts = saving.read(self.folder, "checkpoint")
        if facts.get("identity") != self.run:
            raise InputError(
                f"{self.folder}: holds the checkpoint of a run with other points or settings; "
                "delete it or choose another folder"
            )
        return {name: torch.tensor(array) for name, array in arrays.items()}, facts

    def write_each_minute(self, trainer: Trainer, trace: tuple[TracePoint, ...]) -> None:
        """Write the state if the last one is a minute old. Maps in the trace are not kept."""
        if time.monotonic() - self.written < CHECKPOINT_SECONDS:
            return
        facts = {
            "identity": self.run,
            "trainer": trainer.facts(),
            "trace": [[t.iteration, t.seconds, dict(t.values)] for t in trace],
        }
        arrays = {name: tensor.cpu().numpy() for name, tensor in trainer.tensors().items()}
        saving.write(self.folder, "checkpoint", arrays, facts)
        self.written = time.monotonic()

    def remove(self) -> None:
        """Remove the state: the run is done."""
        saving.remove(self.folder, "checkpoint")
