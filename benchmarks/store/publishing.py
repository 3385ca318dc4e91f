"""Publishing a results folder as one sealed archive, and opening such an archive again.

An archive holds the latest row of each cell, its map, the metrics, the environment of each run, and
`manifest.json`: the hash of every member, the version of each suite, and the hash of each model.
The models themselves stay where they are published: they are loaded by name and compared by hash.
Rows of a user's own files are left out, since nobody else could check them.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from benchmarks.cases import models
from benchmarks.cases.builtin import BUILTIN
from benchmarks.store import measuring, sealing, versions
from benchmarks.store.archives import arrays_hash, surface_arrays
from benchmarks.store.files import Files
from benchmarks.store.records import fields_of, plain
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, row_of
from parapoint.errors import InputError

FORMAT = 1
"""Version of the archive's layout."""


@dataclass(frozen=True)
class Published:
    """What was published.

    Attributes:
        rows: how many rows.
        maps: how many of them have a map.
        own: how many rows of a user's own files were left out.
    """

    rows: int
    maps: int
    own: int


def is_public(case: str) -> bool:
    """Whether a case is a model of the registry, a built-in surface, or sampled from one."""
    return case.partition("@")[0] in {*models.registry(), *BUILTIN}


def publish(folder: Path, archive: Path) -> Published:
    """Write what `folder` holds into a sealed archive; twice gives the same bytes.

    Raises:
        InputError: the folder holds no rows that can be published, or one of its maps is damaged;
            something that is no such archive has that name; the disk is full.
    """
    if archive.exists() and not sealing.is_sealed(archive):
        raise InputError(f"{archive}: is in the way and no archive of ours; take another --out")
    store = Store(folder)
    everything = store.rows()
    rows = [row for row in everything if is_public(row.case)]
    if not rows:
        raise InputError(f"{folder} holds no results of public models: there is nothing to publish")
    maps = [row for row in rows if row.status == "ok"]
    for row in maps:
        store.result(row)
    members: dict[str, bytes | Path] = {
        "rows.jsonl": _lines(fields_of(row) for row in rows),
        "metrics.jsonl": _metrics(store, maps),
        "environment.json": _pretty(store.environment()),
    }
    members |= {f"uv/{row.id}.npz": store.uv_path(row.id) for row in maps}
    members["manifest.json"] = _pretty(_manifest(store, rows, members))
    sealing.write(archive, members)
    return Published(len(rows), len(maps), len(everything) - len(rows))


def _manifest(
    store: Store, rows: list[ResultRow], members: Mapping[str, bytes | Path]
) -> dict[str, Any]:
    """What an archive says of itself."""
    hashes = {}
    for name, content in sorted(members.items()):
        data = content.read_bytes() if isinstance(content, Path) else content
        hashes[name] = hashlib.sha256(data).hexdigest()
    about = {}
    for case in sorted({row.case for row in rows}):
        model = models.registry().get(case.partition("@")[0])
        surfaces = {row.surface_hash for row in rows if row.case == case and row.surface_hash}
        about[case] = {
            "surfaces": sorted(surfaces),
            "sha256": model.sha256 if model else "",
            "licence": model.licence if model else "made in memory",
        }
    return {
        "format": FORMAT,
        "suites": versions.versions(store, rows),
        "models": about,
        "sha256": hashes,
    }


def _metrics(store: Store, maps: list[ResultRow]) -> bytes:
    """A line of JSON for each map: its id and every metric that applies."""
    table = measuring.metrics(store)
    numbers = table.columns[len(measuring.IDENTITY_COLUMNS) : -len(measuring.KEY_COLUMNS)]
    records = dict(zip(table["id"], table[numbers].to_dict("records"), strict=True))
    return _lines(
        {
            "id": row.id,
            "metrics": {
                str(name): plain(value)
                for name, value in records[row.id].items()
                if not math.isnan(value)
            },
        }
        for row in maps
    )


def _lines(records: Iterator[Mapping[str, Any]]) -> bytes:
    return b"".join(json.dumps(record, sort_keys=True).encode() + b"\n" for record in records)


def _pretty(content: object) -> bytes:
    return json.dumps(content, indent=1, sort_keys=True).encode() + b"\n"


@contextmanager
def opened(source: Path) -> Iterator[Store]:
    """A published archive as a results folder without surfaces; or the folder that `source` is.

    Raises:
        InputError: it is neither; the archive has been changed, or is no archive of ours.
    """
    if source.is_dir():
        if not (source / "runs.jsonl").is_file():
            raise InputError(f"{source} is no results folder: it has no runs.jsonl")
        yield Store(source)
        return
    with TemporaryDirectory(prefix="parapoint-") as name:
        folder = Path(name)
        _check(source, folder, sealing.unpack(source, folder))
        (folder / "rows.jsonl").rename(folder / "runs.jsonl")
        yield Store(folder)


def _check(archive: Path, folder: Path, names: list[str]) -> None:
    """Check the members of an archive against its manifest.

    Raises:
        InputError: a member is missing, changed, or not listed; a line is no row.
    """
    try:
        content = json.loads((folder / "manifest.json").read_bytes())
        hashes, version = dict(content["sha256"]), int(content["format"])
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        raise InputError(f"{archive}: has no manifest that can be read") from None
    if version > FORMAT:
        raise InputError(f"{archive}: was written by a newer version (format {version}): update")
    for name in ("rows.jsonl", "metrics.jsonl", "environment.json"):
        if name not in hashes:
            raise InputError(f"{archive}: {name} is missing")
    for name in {*hashes, *names} - {"manifest.json"}:
        if name not in names or name not in hashes:
            raise InputError(f"{archive}: {name} is not both in it and in its manifest")
        if hashlib.sha256((folder / name).read_bytes()).hexdigest() != hashes[name]:
            raise InputError(f"{archive}: {name} is not what the manifest says")
    for number, line in enumerate((folder / "rows.jsonl").read_bytes().splitlines(), start=1):
        row = row_of(line)
        if row is None or (row.status == "ok" and f"uv/{row.id}.npz" not in names):
            raise InputError(
                f"{archive}: rows.jsonl, line {number}: no row, or one without its map"
            )


def published_metrics(store: Store) -> dict[str, dict[str, float]]:
    """The metrics that an opened archive came with, by the row's id and by name.

    Raises:
        InputError: a line cannot be read.
    """
    found: dict[str, dict[str, float]] = {}
    path = store.folder / "metrics.jsonl"
    try:
        for line in path.read_bytes().splitlines():
            record = json.loads(line)
            values = {str(name): float(value) for name, value in record["metrics"].items()}
            found[str(record["id"])] = values
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise InputError("metrics.jsonl: a line of it cannot be read") from None
    return found


def supply_surfaces(store: Store, into: Files, rows: list[ResultRow]) -> dict[str, str]:
    """Store the surface of each row `into` a folder: from the rows' own, or by the model's name.

    A file that is there stays; one that only the rows' own folder has joins it.

    Returns:
        By case, why its surface could not be had: it cannot be loaded, or is another one here.
    """
    faults: dict[str, str] = {}
    for case, name in dict.fromkeys((row.case, row.surface_hash) for row in rows):
        if not name:
            continue
        _copy(store, into, name)
        if into.surface_path(name).exists():
            continue
        try:
            surface = models.load(case) if is_public(case) else None
        except InputError as error:
            faults[case] = str(error)
            continue
        if surface is None or not _is_named(surface_arrays(surface), name):
            faults[case] = "the model is not the one that these rows were computed on"
            continue
        into.add_surface(surface)
        if (exact := models.exact_points(case)) is not None:
            into.add_exact(name, exact)
        if (reference := models.reference(case)) is not None:
            into.add_reference(name, reference)
    return faults


def _is_named(arrays: Mapping[str, Any], name: str) -> bool:
    """Whether the arrays of a surface have the hash that it is named by."""
    return arrays_hash(arrays).startswith(name)


def _copy(store: Files, into: Files, surface_hash: str) -> None:
    """Copy those files of a surface from one folder to another that are not there yet."""
    for here, there in zip(store.paths_of(surface_hash), into.paths_of(surface_hash), strict=True):
        if here.exists() and not there.exists():
            there.parent.mkdir(parents=True, exist_ok=True)
            there.write_bytes(here.read_bytes())
