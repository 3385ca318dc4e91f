"""The npz files of a results folder: surfaces, the maps they came with, and the maps of cells.

The name of a file is a hash of its content, or the id of a row; no other text becomes a path.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from benchmarks.store.archives import (
    HASH,
    arrays_hash,
    disk_said,
    map_arrays,
    read_arrays,
    read_map,
    read_surface,
    replacing,
    surface_arrays,
    sync_folder,
    write_arrays,
)
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud, Surface


class Files:
    """The npz files in a results folder.

    Attributes:
        folder: the results folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def surface_path(self, surface_hash: str) -> Path:
        """Where the surface with that hash lies."""
        return self.folder / "surfaces" / f"{surface_hash}.npz"

    def reference_path(self, surface_hash: str) -> Path:
        """Where the map lies that the model of that surface came with."""
        return self.folder / "references" / f"{surface_hash}.npz"

    def exact_path(self, surface_hash: str) -> Path:
        """Where the points without noise lie of the noisy cloud with that hash."""
        return self.folder / "exact" / f"{surface_hash}.npz"

    def scored_path(self, surface_hash: str) -> Path:
        """Where the surface lies that maps are scored on: without noise, if that is stored."""
        exact = self.exact_path(surface_hash)
        return exact if exact.exists() else self.surface_path(surface_hash)

    def uv_path(self, row_id: str) -> Path:
        """Where the map of the row with that id lies."""
        return self.folder / "uv" / f"{row_id}.npz"

    def surface(self, row: ResultRow) -> Surface:
        """The surface of a row as it was loaded, before any preprocessing.

        Raises:
            InputError: the row has none, or its file is missing or damaged.
        """
        if not row.surface_hash:
            raise InputError(f"{row.case}: no surface is stored ({row.reason})")
        path = self.surface_path(row.surface_hash)
        surface = read_surface(path)
        if not arrays_hash(surface_arrays(surface)).startswith(row.surface_hash):
            raise InputError(f"{path}: damaged (its content does not fit its name)")
        return surface

    def result(self, row: ResultRow) -> Parameterization | PointParameterization:
        """The map of a row that ended ok, with its trace and report.

        Raises:
            InputError: the row has none, or its file is missing or damaged.
        """
        if not row.uv_sha256:
            raise InputError(f"{row.case}, {row.method}: no map is stored ({row.status})")
        path = self.uv_path(row.id)
        result = read_map(path, row.report)
        if arrays_hash(map_arrays(result)) != row.uv_sha256:
            raise InputError(f"{path}: is not the map that was written")
        return result

    def reference(self, row: ResultRow) -> Parameterization | None:
        """The map that the row's model came with; None if it came with none.

        Raises:
            InputError: its file is damaged.
        """
        path = self.reference_path(row.surface_hash)
        reference = read_map(path) if row.surface_hash and path.exists() else None
        return reference if isinstance(reference, Parameterization) else None

    def add_surface(self, surface: Surface) -> str:
        """Store a surface unless it is there already, whole; its hash.

        Raises:
            InputError: the disk is full, here and in the methods below.
        """
        arrays = surface_arrays(surface)
        name = arrays_hash(arrays)[:32]
        path = self.surface_path(name)
        with disk_said(path):
            if path.exists() and not self.is_whole(name):
                self.forget(name)
            if not path.exists():
                write_arrays(path, arrays)
        return name

    def add_reference(self, surface_hash: str, reference: Parameterization) -> None:
        """Store the map that a surface came with, unless that very map is there already."""
        path, arrays = self.reference_path(surface_hash), map_arrays(reference)
        try:
            is_there = arrays_hash(read_arrays(path)) == arrays_hash(arrays)
        except InputError:
            is_there = False
        with disk_said(path):
            if not is_there:
                write_arrays(path, arrays, sealed=True)

    def add_exact(self, surface_hash: str, cloud: PointCloud) -> None:
        """Store the points of a noisy cloud without their noise, unless they are there already."""
        path = self.exact_path(surface_hash)
        with disk_said(path):
            if not path.exists():
                write_arrays(path, surface_arrays(cloud), sealed=True)

    def paths_of(self, surface_hash: str) -> list[Path]:
        """The files that may be stored of a surface."""
        places = (self.surface_path, self.reference_path, self.exact_path)
        return [place(surface_hash) for place in places]

    def is_whole(self, surface_hash: str) -> bool:
        """Whether the surface has the hash that it is named by, and its other files can be read."""
        try:
            content = surface_arrays(read_surface(self.surface_path(surface_hash)))
            for path in self.paths_of(surface_hash)[1:]:
                if path.exists():
                    read_arrays(path)
        except InputError:
            return False
        return arrays_hash(content).startswith(surface_hash)

    def forget(self, surface_hash: str) -> None:
        """Remove the files of a surface, which are ours: their names are its hash."""
        for path in self.paths_of(surface_hash):
            path.unlink(missing_ok=True)

    def add_map(self, row_id: str, path: Path) -> None:
        """Move the map file `path`, which lies on the same disk, to its place.

        Raises:
            FileNotFoundError: it is gone, or no file of the cell's own folder.
            InputError: the disk is full.
        """
        if path.parent.is_symlink() or path.is_symlink() or not path.is_file():
            raise FileNotFoundError(path)
        target = self.uv_path(row_id)
        with disk_said(target):
            target.parent.mkdir(exist_ok=True)
            path.replace(target)
        sync_folder(target.parent)

    def surface_hashes(self) -> dict[str, str]:
        """What `note_surfaces` has kept, as far as the surfaces are still there."""
        try:
            known = json.loads((self.folder / "surfaces.json").read_bytes())
        except (FileNotFoundError, ValueError, RecursionError):
            return {}
        return {
            str(origin): name
            for origin, name in (known.items() if isinstance(known, dict) else ())
            if isinstance(name, str) and HASH.fullmatch(name) and self.surface_path(name).exists()
        }

    def note_surfaces(self, hashes: Mapping[str, str]) -> None:
        """Keep in `surfaces.json` which model file gave which surface.

        A later run need not read these models again.

        Args:
            hashes: hashes of surfaces, by a text that says what each was read from.
        """
        path = self.folder / "surfaces.json"
        with disk_said(path), replacing(path) as stream:
            stream.write(json.dumps(hashes, indent=1).encode() + b"\n")
