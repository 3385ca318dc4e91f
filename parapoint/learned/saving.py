"""Fitted models and the states of runs on disk: JSON facts beside safetensors."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import safetensors
import safetensors.torch
from torch import Tensor

from parapoint.errors import InputError
from parapoint.learned.trainer import Trainer
from parapoint.surfaces.parameterization import TracePoint

FORMAT = 4
"""Version of saved models and checkpoints."""
CHECKPOINT_SECONDS = 60.0


def write(folder: Path, stem: str, tensors: dict[str, Tensor], facts: dict[str, Any]) -> None:
    """Write `stem.json` and the tensors it names, so that a kill leaves the old pair or the new."""
    folder.mkdir(parents=True, exist_ok=True)
    data = safetensors.torch.save({k: t.contiguous().cpu() for k, t in tensors.items()})
    name = f"{stem}-{hashlib.sha256(data).hexdigest()[:16]}.safetensors"
    text = json.dumps({"format": FORMAT, "tensors": name, **facts}, indent=1)
    for path, content in ((folder / name, data), (folder / f"{stem}.json", text.encode())):
        temporary = path.with_name(path.name + ".part")
        temporary.write_bytes(content)
        temporary.replace(path)
    for old in folder.glob(f"{stem}-*.safetensors"):
        if old.name != name:
            old.unlink()


def read(folder: Path, stem: str) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """What `write` wrote.

    Raises:
        InputError: there is no such pair, it is damaged, or of another version.
    """
    path = folder / f"{stem}.json"
    if not path.is_file():
        raise InputError(f"{folder}: no saved model here ({stem}.json is missing)")
    with damage_of(folder):
        facts = json.loads(path.read_text())
        version = facts["format"]
    if version != FORMAT:
        raise InputError(
            f"{path}: format version {version}; this parapoint reads version {FORMAT}: fit anew"
        )
    with damage_of(folder):
        name = facts["tensors"]
        if Path(name).name != name:
            raise InputError(f"{path}: names tensors outside of its folder: {name!r}")
        return safetensors.torch.load((folder / name).read_bytes()), facts


@contextmanager
def damage_of(folder: Path) -> Iterator[None]:
    """Turns what a damaged file causes into an InputError that names the folder."""
    try:
        yield
    except (
        KeyError,
        TypeError,
        ValueError,
        OSError,
        RuntimeError,
        safetensors.SafetensorError,
    ) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{folder}: damaged, fit anew or delete it ({error})") from error


class Checkpoint:
    """The state of a run in a folder, written each minute."""

    def __init__(self, folder: Path, identity: str) -> None:
        self.folder, self.identity = folder, identity
        self.written = time.monotonic()

    def read(self) -> tuple[dict[str, Tensor], dict[str, Any]] | None:
        """The state of an earlier session of this run, None where there is none.

        Raises:
            InputError: the state is of another run, of another version, or damaged.
        """
        if not (self.folder / "checkpoint.json").is_file():
            return None
        tensors, facts = read(self.folder, "checkpoint")
        if facts.get("identity") != self.identity:
            raise InputError(
                f"{self.folder}: holds the checkpoint of a run with other points or settings; "
                "delete it or choose another folder"
            )
        return tensors, facts

    def write_each_minute(self, trainer: Trainer, trace: tuple[TracePoint, ...]) -> None:
        """Write the state if the last one is a minute old. Maps in the trace are not kept."""
        if time.monotonic() - self.written < CHECKPOINT_SECONDS:
            return
        facts = {
            "identity": self.identity,
            "trainer": trainer.facts(),
            "trace": [[t.iteration, t.seconds, dict(t.values)] for t in trace],
        }
        write(self.folder, "checkpoint", trainer.tensors(), facts)
        self.written = time.monotonic()

    def remove(self) -> None:
        """Remove the state: the run is done."""
        for path in self.folder.glob("checkpoint*"):
            path.unlink()
