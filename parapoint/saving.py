"""Fitted models on disk: JSON facts beside arrays, checked before use."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import safetensors
import safetensors.numpy

from parapoint.errors import InputError
from parapoint.files.targets import complete_file

FORMAT = 5
"""Version of saved models and checkpoints."""


def write(folder: Path, stem: str, arrays: dict[str, np.ndarray], facts: dict[str, Any]) -> None:
    """Write `stem.json` and the arrays it names, so that a kill leaves the old pair or the new.

    The arrays that the old `stem.json` names are removed; every other file of the folder stays.
    """
    folder.mkdir(parents=True, exist_ok=True)
    old = _named_arrays(folder / f"{stem}.json")
    data = safetensors.numpy.save({k: np.asarray(of, order="C") for k, of in arrays.items()})
    name = f"{stem}-{_digest(data)}.safetensors"
    text = json.dumps({"format": FORMAT, "tensors": name, **facts}, indent=1, default=_plain)
    for path, content in ((folder / name, data), (folder / f"{stem}.json", text.encode())):
        with complete_file(path) as file:
            file.write(content)
    if old is not None and old.name != name:
        old.unlink(missing_ok=True)


def read(folder: Path, stem: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """What `write` wrote.

    Raises:
        InputError: there is no such pair, it is damaged or changed, or of another version.
    """
    path = folder / f"{stem}.json"
    if not path.is_file():
        raise InputError(f"{folder}: no saved model here ({stem}.json is missing)")
    with damage_of(folder):
        facts = json.loads(path.read_text(encoding="utf-8"))
        version = facts["format"]
    if version != FORMAT:
        raise InputError(
            f"{path}: format version {version}; this parapoint reads version {FORMAT}: fit anew"
        )
    with damage_of(folder):
        name = facts["tensors"]
        if not isinstance(name, str) or Path(name).name != name:
            raise InputError(f"{path}: names tensors outside of its folder: {name!r}")
        data = (folder / name).read_bytes()
        if name != f"{stem}-{_digest(data)}.safetensors":
            raise InputError(
                f"{folder / name}: damaged: its content does not fit its name; fit anew"
            )
        return safetensors.numpy.load(data), facts


def remove(folder: Path, stem: str) -> None:
    """Remove the pair that `write` wrote, and the folder's other files stay."""
    arrays = _named_arrays(folder / f"{stem}.json")
    (folder / f"{stem}.json").unlink(missing_ok=True)
    if arrays is not None:
        arrays.unlink(missing_ok=True)


def check_free(folder: Path, stem: str) -> None:
    """Raise InputError where something that `write` did not write is in its way."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; name a folder")
    path = folder / f"{stem}.json"
    if path.exists() and _named_arrays(path) is None:
        raise InputError(f"{path}: is in the way and not ours; name another folder")


def _named_arrays(path: Path) -> Path | None:
    """The file of arrays that a `stem.json` of ours names; None where it is no such file."""
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
        name = facts["tensors"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
    stem = path.stem
    is_ours = (
        isinstance(name, str)
        and Path(name).name == name
        and name.startswith(f"{stem}-")
        and name.endswith(".safetensors")
    )
    return path.with_name(name) if is_ours else None


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


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
        AttributeError,
        safetensors.SafetensorError,
    ) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{folder}: damaged, fit anew or delete it ({error})") from error


def _plain(value: object) -> object:
    """A number of NumPy as Python's, for JSON."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} cannot be saved")
