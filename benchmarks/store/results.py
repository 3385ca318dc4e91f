"""The result store of a run: rows, maps, surfaces, environment, metrics.

A results folder holds

    runs.jsonl              one line a cell, appended only, by the one process that holds the lock
    uv/<id>.npz             the map of a cell, written before its line
    surfaces/<hash>.npz     each surface as loaded
    references/<hash>.npz   the map that the model of that surface came with
    environment.json        the format version and one entry a run: commit, versions, machine
    surfaces.json           derived: which model file gave which surface
    metrics.parquet         derived from the above; may be deleted, as surfaces.json

Nothing in it is ever overwritten but what is derived. File names are made of hashes alone, and no
file is ever unpickled.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import logging
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from benchmarks.store.archives import (
    arrays_hash,
    disk_said,
    map_arrays,
    read_map,
    read_surface,
    replacing,
    surface_arrays,
    sync_folder,
    write_arrays,
)
from benchmarks.store.records import fields_of, from_fields, loaded, plain
from parapoint.errors import InputError
from parapoint.sources import source_hash
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

if TYPE_CHECKING:
    import pandas as pd

Status = Literal["ok", "skipped", "failed", "timeout", "out_of_memory"]
FORMAT = 1
"""Version of the folder's layout; a folder with a larger one is left alone."""

IDENTITY_COLUMNS = ("suite", "case", "method", "params", "seed", "status")
_NAME = re.compile(r"[0-9a-f]{8,64}")
SOURCE_CHANGED = "the source of the method changed during the run; run again"
"""Reason of a row that the next run does anew whatever its hash says."""
MISSING = "not installed: "
"""Begins the reason of a row that lacked a package or program: the next run tries it again."""
_log = logging.getLogger("parapoint")


@dataclass(frozen=True)
class ResultRow:
    """One cell of a run and how it ended; a line of `runs.jsonl`.

    Attributes:
        id: hash of the cell's identity: suite, case, method, params, seed and the two hashes.
        suite: name of the suite.
        case: canonical name of the model, or the path that was given.
        method: registry name of the method, such as "slim".
        params: all hyperparameters of the method (its dataclass fields).
        seed: seed of the cell.
        source_hash: hash of the method's source.
        surface_hash: hash of the surface as loaded; names `surfaces/<hash>.npz`. "" where the
            model could not be had.
        status: how it ended.
        reason: why, unless ok: one line.
        output: last lines of what the method printed, kept where it did not end well.
        preprocessing: what was done to the surface before the method saw it ("" for nothing).
        seconds: wall time of `parameterize` alone.
        cpu_seconds: processor time of the same, all threads and ended child processes.
        peak_memory_mb: peak resident memory of the cell's processes, in units of 10^6 bytes.
        uv_file: `uv/<id>.npz`, or "" where there is no map.
        uv_sha256: `arrays_hash` of the map: the same map has the same hash, whatever its trace.
        report: what the method wrote beside its result (energies, iterations, weights).
        run: entry of `environment()["runs"]` in which the cell ran.
        host: name and processor of the worker that ran it; "" where that was the run's own machine.
    """

    id: str
    suite: str
    case: str
    method: str
    params: Mapping[str, object]
    seed: int
    source_hash: str
    surface_hash: str
    status: Status
    reason: str = ""
    output: str = ""
    preprocessing: str = ""
    seconds: float | None = None
    cpu_seconds: float | None = None
    peak_memory_mb: float | None = None
    uv_file: str = ""
    uv_sha256: str = ""
    report: Mapping[str, object] = field(default_factory=dict)
    run: int = 0
    host: str = ""

    @property
    def cell(self) -> str:
        """What the row answers, whatever the versions: suite, case, method, params and seed."""
        parts = [self.suite, self.case, self.method, plain(self.params), self.seed]
        return json.dumps(parts, sort_keys=True)


def identity(
    *,
    suite: str,
    case: str,
    method: str,
    params: Mapping[str, object],
    seed: int,
    source_hash: str,
    surface_hash: str,
) -> str:
    """The id of a cell: 32 hexadecimal digits."""
    parts = [suite, case, method, plain(params), seed, source_hash, surface_hash]
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _write_whole(stream: int, line: bytes) -> None:
    """Write `line` in one write and put it onto the disk."""
    if os.write(stream, line) != len(line):
        raise OSError(errno.ENOSPC, "short write")
    os.fsync(stream)


def _row(line: bytes) -> ResultRow | None:
    """The row of a line of `runs.jsonl`, or None where the line is no whole row."""
    try:
        row = from_fields(ResultRow, loaded(line))
    except ValueError:
        return None
    names = (row.id, row.surface_hash) if row.surface_hash else (row.id,)
    return row if all(_NAME.fullmatch(name) for name in names) else None


class Store:
    """The results in a folder. Reading needs nothing; writing happens inside `writing()`.

    Attributes:
        folder: the results folder.
    """

    def __init__(self, folder: Path | str) -> None:
        """The store in `folder`, which need not exist yet.

        Raises:
            InputError: `folder` is a file, or was written by a newer version.
        """
        self.folder = Path(folder)
        self._stream: int | None = None
        if self.folder.exists() and not self.folder.is_dir():
            raise InputError(f"{self.folder} is a file; name a folder for the results")
        version = self.environment().get("format", FORMAT)
        if not isinstance(version, int) or version > FORMAT:
            raise InputError(
                f"{self.folder} was written by a newer version (results format {version}; this "
                f"one reads up to {FORMAT}): update, or name another folder"
            )

    @property
    def _runs(self) -> Path:
        return self.folder / "runs.jsonl"

    def _lines(self) -> list[bytes]:
        """The lines of `runs.jsonl` that end: one that does not is torn, or being written."""
        try:
            return self._runs.read_bytes().split(b"\n")[:-1]
        except FileNotFoundError:
            return []

    def history(self) -> list[ResultRow]:
        """Every row ever written, oldest first; lines that are no row are left out and said."""
        rows = [_row(line) for line in self._lines()]
        bad = sum(row is None for row in rows)
        if bad:
            _log.warning("%s: %d damaged lines left out", self._runs, bad)
        return [row for row in rows if row is not None]

    def rows(self) -> list[ResultRow]:
        """The latest row of each cell, in the order in which the cells first ran.

        A row of an older source or surface gives way to the newer one of the same suite, case,
        method, parameters and seed; `history()` has both.
        """
        return list({row.cell: row for row in self.history()}.values())

    def environment(self) -> dict[str, Any]:
        """`{"format": 1, "runs": [...]}`: one entry a run with commit, versions and machine.

        Raises:
            InputError: the file is damaged.
        """
        path = self.folder / "environment.json"
        try:
            content = json.loads(path.read_bytes())
        except FileNotFoundError:
            return {"format": FORMAT, "runs": []}
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict) or not isinstance(content.get("runs"), list):
            raise InputError(f"{path}: damaged; restore it, or name another folder")
        return content

    def surface(self, row: ResultRow) -> Surface:
        """The surface of a row as it was loaded, before any preprocessing.

        Raises:
            InputError: the row has none, or its file is missing or damaged.
        """
        if not row.surface_hash:
            raise InputError(f"{row.case}: no surface is stored ({row.reason})")
        return read_surface(self.surface_path(row.surface_hash))

    def result(self, row: ResultRow) -> Parameterization | PointParameterization:
        """The map of an `ok` row, with its trace and report.

        Raises:
            InputError: the row has none, or its file is missing or damaged.
        """
        if not row.uv_sha256:
            raise InputError(f"{row.case}, {row.method}: no map is stored ({row.status})")
        return read_map(self.uv_path(row.id), row.report)

    def reference(self, row: ResultRow) -> Parameterization | None:
        """The map that the row's model came with, if it did.

        Raises:
            InputError: its file is damaged.
        """
        path = self.reference_path(row.surface_hash)
        reference = read_map(path) if row.surface_hash and path.exists() else None
        return reference if isinstance(reference, Parameterization) else None

    def unmeasured(self) -> list[ResultRow]:
        """The rows with a map whose metrics are not in `metrics.parquet`, or of an older source."""
        frame = self._metrics_table()
        known = set() if frame is None else set(frame["metrics_key"])
        keys = self._metrics_keys(rows := self.rows())
        return [row for row in rows if row.uv_sha256 and keys[row.id] not in known]

    def metrics(self, measured: Mapping[str, Mapping[str, float]] | None = None) -> pd.DataFrame:
        """One row a cell: suite, case, method, params, seed, status, every metric by name, id.

        `params` is a JSON string; a metric that does not apply is null. Computed from the stored
        maps, only for what is missing in or has changed since `metrics.parquet`, which is updated.

        Args:
            measured: values by row id that were computed elsewhere; none in it, nulls in the table.
        """
        import pandas as pd

        names = _metric_names()
        table = self._metrics_table()
        keys = self._metrics_keys(rows := self.rows())
        if table is not None and table["metrics_key"].tolist() == [keys[row.id] for row in rows]:
            return table
        known = _by_key(table)
        records: list[dict[str, object]] = []
        for row in rows:
            key = keys[row.id]
            if key in known:
                values = known[key]
            else:
                given = (measured or {}).get(row.id)
                values = self._measured(row) if given is None else dict(given)
            cell = (row.suite, row.case, row.method, json.dumps(row.params), row.seed, row.status)
            start = dict(zip(IDENTITY_COLUMNS, cell, strict=True))
            records.append({**start, **values, "id": row.id, "metrics_key": key})
        extra = {name for record in records for name in record}
        extra -= {*IDENTITY_COLUMNS, *names, "id", "metrics_key"}
        numbers = [*names, *sorted(extra)]
        columns = [*IDENTITY_COLUMNS, *numbers, "id", "metrics_key"]
        frame = pd.DataFrame.from_records(records, columns=columns)
        frame = frame.astype(dict.fromkeys(numbers, "float64") | {"seed": "int64"})
        self._write_metrics(frame)
        return frame

    def _write_metrics(self, frame: pd.DataFrame) -> None:
        """Put `frame` into `metrics.parquet`; a folder that may only be read is left as it is."""
        path = self.folder / "metrics.parquet"
        content = io.BytesIO()
        frame.to_parquet(content, index=False)
        with contextlib.suppress(PermissionError), disk_said(path), replacing(path) as stream:
            stream.write(content.getbuffer())

    def faults(self, sample: int = 20) -> Iterator[str]:
        """What is wrong in the folder, one line each.

        Every row against its files: hashes, shapes, finite values. Of `metrics.parquet`, `sample`
        rows spread evenly are computed anew.
        """
        for number, line in enumerate(self._lines(), start=1):
            if _row(line) is None:
                yield f"runs.jsonl, line {number}: no whole row"
        rows = self.rows()
        sizes: dict[str, int] = {}
        for surface_hash in dict.fromkeys(row.surface_hash for row in rows if row.surface_hash):
            try:
                surface = read_surface(self.surface_path(surface_hash))
            except InputError as error:
                yield str(error)
                continue
            if arrays_hash(surface_arrays(surface))[: len(surface_hash)] != surface_hash:
                yield f"{self.surface_path(surface_hash)}: its content does not fit its name"
            sizes[surface_hash] = len(
                surface.faces if isinstance(surface, Mesh) else surface.points
            )
        for row in rows:
            for fault in self._row_faults(row, sizes.get(row.surface_hash)):
                yield f"{row.case}, {row.method}, seed {row.seed} ({row.id}): {fault}"
        yield from self._metric_faults(rows, sample)

    def _row_faults(self, row: ResultRow, size: int | None) -> Iterator[str]:
        """What is wrong with a row whose surface has `size` faces, or points."""
        names = ("suite", "case", "method", "params", "seed", "source_hash", "surface_hash")
        if row.id != identity(**{name: getattr(row, name) for name in names}):
            yield "its id is not that of its contents"
        if row.status != "ok":
            return
        try:
            result = self.result(row)
        except InputError as error:
            yield str(error)
            return
        if arrays_hash(map_arrays(result)) != row.uv_sha256:
            yield f"{row.uv_file} is not the map that was written"
        found = len(result.corners if isinstance(result, Parameterization) else result.uv)
        if size is not None and found != size:
            yield f"{row.uv_file} has {found} rows for {size} faces or points"

    def _metric_faults(self, rows: list[ResultRow], sample: int) -> Iterator[str]:
        """Where `metrics.parquet` differs from what `sample` of the maps give."""
        known = _by_key(self._metrics_table())
        keys = self._metrics_keys(rows)
        measured = [row for row in rows if row.status == "ok" and keys[row.id] in known]
        for row in measured[:: max(1, len(measured) // sample)][:sample]:
            stored = known[keys[row.id]]
            for name, value in self._measured(row).items():
                if not math.isclose(value, stored.get(name, math.nan), rel_tol=1e-9):
                    if math.isnan(value) and math.isnan(stored.get(name, math.nan)):
                        continue
                    yield (
                        f"{row.case}, {row.method}, seed {row.seed} ({row.id}): {name} is "
                        f"{stored.get(name)} in metrics.parquet, {value} from the map"
                    )

    def _metrics_table(self) -> pd.DataFrame | None:
        """What is in `metrics.parquet`; None where it is missing or damaged."""
        import pandas as pd
        import pyarrow as pa

        path = self.folder / "metrics.parquet"
        try:
            frame = pd.read_parquet(path)
        except FileNotFoundError:
            return None
        except (OSError, ValueError, KeyError, pa.ArrowException):
            frame = pd.DataFrame()
        columns = list(frame.columns)
        numbers = columns[len(IDENTITY_COLUMNS) : -2]
        whole = columns == [*IDENTITY_COLUMNS, *numbers, "id", "metrics_key"]
        whole = whole and frame["metrics_key"].is_unique
        if not whole or set(map(str, frame[numbers].dtypes)) - {"float64"}:
            _log.warning("%s: damaged; computed anew", path)
            return None
        return frame

    def _metrics_keys(self, rows: Sequence[ResultRow]) -> dict[str, str]:
        """What the metrics of each row depend on, by its id: map, any reference, their source."""
        source = source_hash("benchmarks.metrics.table")
        references = {path.stem for path in (self.folder / "references").glob("*.npz")}
        exact = {path.stem for path in (self.folder / "exact").glob("*.npz")}
        texts = {
            row.id: f"{row.id} {row.uv_sha256} {row.surface_hash in references} "
            f"{row.surface_hash in exact} {source}"
            for row in rows
        }
        return {key: hashlib.sha256(text.encode()).hexdigest()[:32] for key, text in texts.items()}

    def _measured(self, row: ResultRow) -> dict[str, float]:
        """Every metric of a row's map; none where it has no map or its files are damaged."""
        if not row.uv_sha256:
            return {}
        try:
            surface = read_surface(self.scored_path(row.surface_hash))
            return measured(surface, self.result(row), self.reference(row))
        except InputError as error:
            _log.warning("%s, %s: no metrics: %s", row.case, row.method, error)
            return {}

    def surface_path(self, surface_hash: str) -> Path:
        """Where the surface of that hash lies."""
        return self.folder / "surfaces" / f"{surface_hash}.npz"

    def reference_path(self, surface_hash: str) -> Path:
        """Where the map lies that the surface of that hash came with."""
        return self.folder / "references" / f"{surface_hash}.npz"

    def exact_path(self, surface_hash: str) -> Path:
        """Where the points lie, without their noise, of the cloud of that hash."""
        return self.folder / "exact" / f"{surface_hash}.npz"

    def scored_path(self, surface_hash: str) -> Path:
        """Where the surface lies on which a map is scored: the points without noise, if stored."""
        exact = self.exact_path(surface_hash)
        return exact if exact.exists() else self.surface_path(surface_hash)

    def uv_path(self, row_id: str) -> Path:
        """Where the map of that row lies."""
        return self.folder / "uv" / f"{row_id}.npz"

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Holds the folder for this process alone, made if need be; a torn last line is set aside.

        The lock is the system's own on an open file: it ends with its process, however that ends.

        Raises:
            InputError: another run holds the folder, or the disk is full.
        """
        import filelock

        path = self.folder / "lock"
        with disk_said(self.folder):
            self.folder.mkdir(parents=True, exist_ok=True)
            lock = filelock.FileLock(path, timeout=0)
            try:
                lock.acquire()
            except filelock.Timeout:
                raise InputError(
                    f"{self.folder} is in use by another run; wait for it, or name another folder"
                ) from None
        try:
            with disk_said(self._runs):
                self._set_torn_line_aside()
                self._stream = os.open(self._runs, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
            yield
        finally:
            if self._stream is not None:
                os.close(self._stream)
                self._stream = None
            lock.release()

    def _set_torn_line_aside(self) -> None:
        """Move what follows the last whole row to `runs.torn`, and say so."""
        if not self._runs.exists():
            return
        content = self._runs.read_bytes()
        end = len(content)
        while end and not (
            content[end - 1 : end] == b"\n"
            and _row(content[content.rfind(b"\n", 0, end - 1) + 1 : end - 1])
        ):
            end = content.rfind(b"\n", 0, end - 1) + 1
        if end == len(content):
            return
        aside = self.folder / "runs.torn"
        with aside.open("ab") as stream:
            stream.write(content[end:] + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        with self._runs.open("r+b") as stream:
            stream.truncate(end)
            os.fsync(stream.fileno())
        _log.warning(
            "%s: the last line was torn (%d bytes); it is set aside in %s and its cell runs again",
            self._runs,
            len(content) - end,
            aside.name,
        )

    def append(self, row: ResultRow) -> None:
        """Write a row at the end: one line, one write, onto the disk. All or nothing.

        Raises:
            InputError: the disk is full.
        """
        assert self._stream is not None, "append is for the process inside writing()"
        line = json.dumps(fields_of(row)).encode() + b"\n"
        before = os.fstat(self._stream).st_size
        with disk_said(self._runs):
            try:
                _write_whole(self._stream, line)
            except OSError:
                os.ftruncate(self._stream, before)
                raise

    def add_surface(self, surface: Surface) -> str:
        """Store `surface` unless it is there; its hash."""
        arrays = surface_arrays(surface)
        name = arrays_hash(arrays)[:32]
        path = self.surface_path(name)
        with disk_said(path):
            if not path.exists():
                write_arrays(path, arrays)
        return name

    def add_reference(self, surface_hash: str, reference: Parameterization) -> None:
        """Store the map that a surface came with, unless it is there."""
        path = self.reference_path(surface_hash)
        with disk_said(path):
            if not path.exists():
                write_arrays(path, map_arrays(reference))

    def add_exact(self, surface_hash: str, cloud: PointCloud) -> None:
        """Store the points without noise of a cloud, unless they are there."""
        path = self.exact_path(surface_hash)
        with disk_said(path):
            if not path.exists():
                write_arrays(path, surface_arrays(cloud))

    def surface_hashes(self) -> dict[str, str]:
        """Hashes of surfaces in the store by what they were read from, as `note_surfaces` says."""
        try:
            known = json.loads((self.folder / "surfaces.json").read_bytes())
        except (FileNotFoundError, ValueError, RecursionError):
            return {}
        return {
            str(origin): name
            for origin, name in (known.items() if isinstance(known, dict) else ())
            if isinstance(name, str) and _NAME.fullmatch(name) and self.surface_path(name).exists()
        }

    def note_surfaces(self, hashes: Mapping[str, str]) -> None:
        """Keep what `surface_hashes` is to return: a later run need not read those models."""
        path = self.folder / "surfaces.json"
        with disk_said(path), replacing(path) as stream:
            stream.write(json.dumps(hashes, indent=1).encode() + b"\n")

    def add_map(self, row_id: str, path: Path) -> None:
        """Take over the map file `path`, which lies on the same disk, for the row `row_id`."""
        target = self.uv_path(row_id)
        with disk_said(target):
            target.parent.mkdir(exist_ok=True)
            path.replace(target)
        sync_folder(target.parent)

    def add_run(self, entry: Mapping[str, object]) -> int:
        """Add an entry to `environment.json`; its number."""
        content = self.environment()
        content["runs"].append(plain(entry))
        path = self.folder / "environment.json"
        with disk_said(path), replacing(path) as stream:
            stream.write(json.dumps(content, indent=1).encode() + b"\n")
        return len(content["runs"]) - 1


def measured(
    surface: Surface,
    result: Parameterization | PointParameterization,
    reference: Parameterization | None = None,
) -> dict[str, float]:
    """Every metric of a map; with a reference, those against it as well.

    Raises:
        InputError: the map is not one of this surface.
    """
    from benchmarks.metrics import table as metrics

    if isinstance(surface, Mesh) and isinstance(result, Parameterization):
        return metrics.evaluate(surface, result, reference)
    if isinstance(surface, PointCloud) and isinstance(result, PointParameterization):
        return metrics.evaluate_points(surface, result)
    raise InputError("a map of a mesh for a point cloud, or the other way round")


def _by_key(table: pd.DataFrame | None) -> dict[str, dict[str, float]]:
    """The values of a metrics table by their key."""
    if table is None:
        return {}
    values = table.drop(columns=[*IDENTITY_COLUMNS, "id"]).set_index("metrics_key")
    return {str(key): record for key, record in values.to_dict("index").items()}  # type: ignore[misc]


def _metric_names() -> list[str]:
    """Names of all metrics in the order of the registry."""
    from benchmarks.metrics.table import METRICS

    return list(METRICS)
