"""The scratch folder of a run: made by us, known by a mark, and never anybody else's."""

from __future__ import annotations

import shutil
from pathlib import Path

from parapoint.errors import InputError

NAME = ".parapoint-cells"
"""Name of the scratch folder below a folder of results."""
MARK = ".made-by-parapoint"
"""Name of the file by which a scratch folder is known as ours."""


def clear(folder: Path) -> None:
    """Make an empty scratch folder; what a run that was killed has left in it is removed.

    Raises:
        InputError: there is something of that name that we did not make.
    """
    remove(folder)
    is_free = not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))
    if folder.is_symlink() or not is_free:
        raise InputError(f"{folder}: is in the way and not ours; move it, or take another --out")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MARK).touch()


def remove(folder: Path) -> None:
    """Remove a scratch folder; a folder without our mark, or a link to one, stays."""
    if not folder.is_symlink() and (folder / MARK).is_file():
        shutil.rmtree(folder, ignore_errors=True)
