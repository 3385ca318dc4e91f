"""The files that a model names, and that belong to it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from parapoint.files.decoding import plain
from parapoint.files.meshes.gltf import opened
from parapoint.files.meshes.materials import libraries, library_pictures
from parapoint.files.meshes.pictures import named_file
from parapoint.files.meshes.ply import named_pictures
from parapoint.files.reading import UNREADABLE


def files_named_in(model: Path) -> list[Path]:
    """The material libraries, pictures and buffers that a model names and that are there.

    The list is empty where the model cannot be read; whoever reads it says so.
    """
    of: dict[str, Callable[[Path], list[Path]]] = {
        ".obj": _of_obj,
        ".ply": _of_ply,
        ".glb": lambda path: opened(path).files(),
        ".gltf": lambda path: opened(path).files(),
    }
    if model.suffix.lower() in of:
        with suppress(OSError, *UNREADABLE):
            return [path for path in of[model.suffix.lower()](model) if path.is_file()]
    return []


def _of_obj(path: Path) -> list[Path]:
    named = libraries(path)[0]
    return [*named, *(picture for library in named for picture in library_pictures(library))]


def _of_ply(path: Path) -> list[Path]:
    named = [named_file(path.parent, name) for name in named_pictures(plain(path.read_bytes()))]
    return [picture for picture in named if picture is not None]
