"""Where results come from: the commit, versions and machine of each run, in `environment.json`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.store.archives import disk_said, replacing
from benchmarks.store.records import plain
from parapoint.errors import InputError

FORMAT = 1
"""Version of the results folder's layout. A folder with a larger one is left alone."""


def environment(folder: Path) -> dict[str, Any]:
    """The runs of a results folder: `{"format": 1, "runs": [...]}`, one entry a run.

    Raises:
        InputError: the file is damaged, or was written by a newer version.
    """
    path = folder / "environment.json"
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: damaged (no file, but a folder, a pipe or a device)")
    try:
        content = json.loads(path.read_bytes())
    except FileNotFoundError:
        return {"format": FORMAT, "runs": []}
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict) or not isinstance(content.get("runs"), list):
        raise InputError(f"{path}: damaged; restore it, or name another folder")
    version = content.get("format", FORMAT)
    if not isinstance(version, int) or version > FORMAT:
        raise InputError(
            f"{folder} was written by a newer version (results format {version}; this "
            f"one reads up to {FORMAT}): update, or name another folder"
        )
    return content


def begin(folder: Path) -> None:
    """Write `environment.json` without a run unless it is there: the folder is known as ours by it.

    Raises:
        InputError: the disk is full.
    """
    if not (folder / "environment.json").exists():
        _write(folder, {"format": FORMAT, "runs": []})


def _write(folder: Path, content: Mapping[str, Any]) -> None:
    path = folder / "environment.json"
    with disk_said(path), replacing(path) as stream:
        stream.write(json.dumps(content, indent=1).encode() + b"\n")


def add_run(folder: Path, entry: Mapping[str, object]) -> int:
    """Add the entry of a run to `environment.json`; its number.

    Raises:
        InputError: the file is damaged, or the disk is full.
    """
    content = environment(folder)
    content["runs"].append(plain(entry))
    _write(folder, content)
    return len(content["runs"]) - 1
