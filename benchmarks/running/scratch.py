"""The scratch folder of a run. A mark in it tells that a run made it; no other is ever touched."""

from __future__ import annotations

import shutil
from pathlib import Path

from parapoint.errors import InputError

NAME = ".parapoint-cells"
"""Name of the scratch folder inside a results folder."""
MARK = ".made-by-parapoint"
"""Name of the file that marks a folder as a scratch folder."""


def clear(folder: Path) -> None:
    """Make an empty scratch folder, and remove what a killed run has left in it.

    Raises:
        InputError: something of that name exists that no run made.
    """
    remove(folder)
    is_free = not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))
    if folder.is_symlink() or not is_free:
        raise InputError(f"{folder}: is in the way and not ours; move it, or take another --out")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()


def renew(folder: Path) -> None:
    """Make a scratch folder of this run again if a cell has removed it or put a file in its place.

    Raises:
        OSError: it cannot be made.
    """
    if folder.is_symlink() or (folder.exists() and not folder.is_dir()):
        folder.unlink()
    folder.mkdir(mode=0o700, exist_ok=True)
    (folder / MARK).touch()


def remove(folder: Path) -> None:
    """Remove a scratch folder. A folder without the mark stays, and so does a link to a folder."""
    if not folder.is_symlink() and (folder / MARK).is_file():
        shutil.rmtree(folder, ignore_errors=True)
