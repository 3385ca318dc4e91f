"""Merging results folders and archives into a new folder."""

from __future__ import annotations

import dataclasses
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.store import publishing, versions
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError


@dataclass
class Merged:
    """What was merged.

    Attributes:
        rows: number of rows in the new folder.
        same: number of rows that several sources have alike; each is there once.
        contested: cells that several sources answer in another way; the first source's stay.
        unversioned: by suite, how many rows are older than versions of suites.
    """

    rows: int = 0
    same: int = 0
    contested: list[str] = field(default_factory=list)
    unversioned: dict[str, int] = field(default_factory=dict)


def merge(sources: Sequence[Path], out: Path) -> Merged:
    """Write the latest row of each cell of all sources, and its files, into the new folder `out`.

    Raises:
        InputError: `out` is there already; a source is no results folder and no archive of ours;
            they hold rows of different versions of a suite, or of models that are others here;
            the disk is full. Nothing has been written then.
    """
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise InputError(f"{out}: is there already; name a new folder for what is merged")
    with ExitStack() as stack:
        stores = [(path, stack.enter_context(publishing.opened(path))) for path in sources]
        told = _versions(stores)
        folder = stack.enter_context(_new(out))
        merged = _join(stores, Store(folder))
        merged.unversioned = told
        folder.rename(out)
    return merged


@contextmanager
def _new(out: Path) -> Iterator[Path]:
    """A folder beside `out`, which is removed unless it has been given that name."""
    out.parent.mkdir(parents=True, exist_ok=True)
    folder = out.with_name(f".{out.name}.{os.getpid()}.part")
    folder.mkdir()
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _versions(stores: Sequence[tuple[Path, Store]]) -> dict[str, int]:
    """Check that all rows of a suite are of one version; how many have none.

    Raises:
        InputError: they are not.
    """
    found: dict[str, dict[str, list[str]]] = {}
    unknown: dict[str, int] = {}
    for path, store in stores:
        for suite, counts in versions.versions(store, store.rows()).items():
            if count := counts.pop(versions.UNKNOWN, 0):
                unknown[suite] = unknown.get(suite, 0) + count
            for name in counts:
                found.setdefault(suite, {}).setdefault(name, []).append(str(path))
    for suite, places in found.items():
        if len(places) > 1:
            said = "; ".join(f"version {name} in {', '.join(at)}" for name, at in places.items())
            raise InputError(
                f"rows of different versions of {suite} are not mixed: {said}; merge those of one"
            )
    return unknown


def _join(stores: Sequence[tuple[Path, Store]], into: Store) -> Merged:
    """Write the rows of all stores, and their files, into an empty one."""
    merged = Merged()
    kept: dict[str, ResultRow] = {}
    with into.writing():
        for path, store in stores:
            numbers = [into.add_run(entry) for entry in store.environment()["runs"]]
            wanted, alike = [], []
            for row in store.rows():
                first = kept.get(row.cell)
                if first is None:
                    kept[row.cell] = row
                    wanted.append(row)
                elif (first.id, first.uv_sha256) == (row.id, row.uv_sha256):
                    merged.same += 1
                    alike.append(row)
                else:
                    merged.contested.append(f"{row.case}, {row.method}, seed {row.seed}: {path}")
            faults = publishing.supply_surfaces(store, into, [*wanted, *alike])
            if faults:
                case, reason = next(iter(faults.items()))
                raise InputError(f"{path}: {case}: {reason}")
            for row in wanted:
                if row.status == "ok":
                    store.result(row)
                    target = into.uv_path(row.id)
                    target.parent.mkdir(exist_ok=True)
                    shutil.copyfile(store.uv_path(row.id), target)
                number = numbers[row.run] if 0 <= row.run < len(numbers) else row.run
                into.append(dataclasses.replace(row, run=number))
    merged.rows = len(kept)
    (into.folder / "lock").unlink(missing_ok=True)
    return merged
