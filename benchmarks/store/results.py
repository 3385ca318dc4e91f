"""The result store: everything that runs have written into a results folder.

A results folder holds

    runs.jsonl              one line a cell; only ever appended to, by the process that has the lock
    uv/<id>.npz             the map of a cell, written before its line
    surfaces/<hash>.npz     each surface as it was loaded
    references/<hash>.npz   the map that the model of that surface came with
    exact/<hash>.npz        the points of that noisy cloud without their noise
    environment.json        the format's version, and one entry a run: commit, versions, machine
    surfaces.json           derived: which model file gave which surface
    metrics.parquet         derived: the metrics of every map (`benchmarks.store.measuring`)

Only what is derived is ever overwritten, and it may be deleted. No file is ever unpickled.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from benchmarks.store import provenance
from benchmarks.store.archives import disk_said
from benchmarks.store.files import Files
from benchmarks.store.rows import ResultRow, RowFile
from parapoint.errors import InputError

NAMES = (
    *("lock", "runs.jsonl", "runs.torn", "surfaces.json", "metrics.parquet"),
    *("uv", "surfaces", "references", "exact"),
)
"""What a run may make in a results folder, once `environment.json` is there."""


class Store(Files):
    """The results in a folder. Anybody may read them; they are written inside `writing()`."""

    def __init__(self, folder: Path | str) -> None:
        """The store in `folder`, which need not exist yet.

        Raises:
            InputError: `folder` is a file, is damaged, or was written by a newer version.
        """
        super().__init__(Path(folder))
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"{self.folder} is a file; name a folder for the results")
        self.row_file = RowFile(self.folder / "runs.jsonl")
        self.environment()

    def history(self) -> list[ResultRow]:
        """Every row ever written, oldest first."""
        return self.row_file.rows()

    def rows(self) -> list[ResultRow]:
        """The latest row of each cell, in the order in which the cells first ran.

        A row of an older source or surface gives way to the newer one of the same suite, case,
        method, parameters and seed; `history()` has both. An id is one cell's: further cells that
        claim it, in lines that somebody changed, have no row.
        """
        by_id: dict[str, ResultRow] = {}
        for row in {row.cell: row for row in self.history()}.values():
            by_id.setdefault(row.id, row)
        return list(by_id.values())

    def append(self, row: ResultRow) -> None:
        """Write a row, inside `writing()`: all of it or nothing.

        Raises:
            InputError: the disk is full.
        """
        self.row_file.append(row)

    def environment(self) -> dict[str, Any]:
        """The commit, versions and machine of each run, as `provenance.environment` says.

        Raises:
            InputError: the file is damaged, or was written by a newer version.
        """
        return provenance.environment(self.folder)

    def add_run(self, entry: Mapping[str, object]) -> int:
        """Add the environment of a run; its number.

        Raises:
            InputError: the file is damaged, or the disk is full.
        """
        return provenance.add_run(self.folder, entry)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Hold the folder for this process alone; it is made if need be.

        The lock is the system's own on an open file: it ends with its process, however that ends.

        Raises:
            InputError: another run holds the folder, the disk is full, or something in the folder
                has the name of a file of ours and no run has written it.
        """
        import filelock

        with disk_said(self.folder):
            self._check_ours()
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = filelock.FileLock(self.folder / "lock", timeout=0)
            try:
                lock.acquire()
            except filelock.Timeout:
                raise InputError(
                    f"{self.folder} is in use by another run; wait for it, or name another folder"
                ) from None
        try:
            provenance.begin(self.folder)
            with self.row_file.appending():
                yield
        finally:
            lock.release()

    def _check_ours(self) -> None:
        """Check that a folder without our record holds nothing that we would add to or replace.

        Raises:
            InputError: it does.
        """
        if (self.folder / "environment.json").exists():
            return
        for name in NAMES:
            path = self.folder / name
            # A run that was killed at its very beginning leaves an empty lock.
            if path.is_symlink() or (path.exists() and not (name == "lock" and _is_empty(path))):
                raise InputError(f"{path}: is in the way and not ours; take another --out")


def _is_empty(path: Path) -> bool:
    return path.is_file() and path.stat().st_size == 0
