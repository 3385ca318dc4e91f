"""The rows of a results folder: what a row holds, and the file that they are appended to."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from benchmarks.store.archives import HASH, disk_said
from benchmarks.store.records import fields_of, from_fields, loaded, plain

Status = Literal["ok", "skipped", "failed", "timeout", "out_of_memory"]
SOURCE_CHANGED = "the source of the method changed during the run; run again"
"""Reason of a row that the next run repeats, whatever hash it has."""
MISSING = "not installed: "
"""How the reason begins where a package or program was missing; the next run tries again."""
MACHINE = "through no fault of the method: "
"""How the reason begins where this machine failed, by a full disk or a damaged file; the next run
tries again."""
SUBMITTED = "submitted"
"""The method of rows whose maps somebody else has made (`benchmarks.store.submissions`); what it is
called is its parameter `name`."""
KILLED = ("SIGHUP", "SIGINT", "SIGQUIT", "SIGKILL", "SIGTERM")
"""Signals that come from outside, as a rule: a cell that one of them has ended is tried again."""
WATCHER_KILLED = "the process that watched over it was killed"
"""Reason of a row whose supervisor ended before the cell; the next run tries again."""
IDENTITY = ("suite", "case", "method", "params", "seed", "source_hash", "surface_hash", "threads")
"""The fields of a row that its id is made of."""
_log = logging.getLogger("parapoint")


@dataclass(frozen=True)
class ResultRow:
    """One cell of a run and how it ended; a line of `runs.jsonl`.

    Attributes:
        id: hash of the cell's identity: suite, case, method, params, seed, the two hashes, threads.
        suite: name of the suite.
        case: canonical name of the model, or the path that was given.
        method: registry name of the method, such as "slim".
        params: all hyperparameters of the method (its dataclass fields).
        seed: seed of the cell.
        source_hash: hash of the method's source.
        surface_hash: hash of the surface as loaded, which names `surfaces/<hash>.npz`; "" if the
            model could not be had.
        status: how the cell ended.
        reason: why, in one line; "" if it ended ok.
        output: the last lines that the method printed, unless the cell ended ok.
        preprocessing: what was done to the surface before the method saw it; "" for nothing.
        seconds: wall time of `parameterize` alone.
        cpu_seconds: processor time of the same, over all threads and ended child processes.
        load: how busy the machine was: processes that ran or waited for a processor, over the
            number of processors (`benchmarks.running.environment.load`); None if not known.
        peak_memory_mb: peak resident memory of the cell's processes, in units of 10^6 bytes.
        uv_file: `uv/<id>.npz`; "" if there is no map.
        uv_sha256: `arrays_hash` of the map. The trace does not count, so equal maps have equal
            hashes.
        report: what the method wrote beside its result, such as energies and iterations.
        run: the entry of `environment()["runs"]` in which the cell ran.
        threads: how many threads the cell could use, where its map depends on it; None elsewhere.
        host: name and processor of the worker that ran it; "" on the run's own machine.
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
    load: float | None = None
    peak_memory_mb: float | None = None
    uv_file: str = ""
    uv_sha256: str = ""
    report: Mapping[str, object] = field(default_factory=dict)
    run: int = 0
    host: str = ""
    threads: int | None = None

    @property
    def cell(self) -> str:
        """The question that the row answers: suite, case, method, params and seed, no versions."""
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
    threads: int | None = None,
) -> str:
    """The id of a cell: 32 hexadecimal digits. `threads` counts where the map depends on it."""
    parts = [suite, case, method, plain(params), seed, source_hash, surface_hash]
    parts += [] if threads is None else [threads]
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def row_of(line: bytes) -> ResultRow | None:
    """The row in a line of `runs.jsonl`; None if the line is not a whole row."""
    try:
        row = from_fields(ResultRow, loaded(line))
    except ValueError:
        return None
    names = (row.id, row.surface_hash) if row.surface_hash else (row.id,)
    named = all(HASH.fullmatch(name) for name in names)
    return row if named and 0 <= row.seed < 2**63 else None


class RowFile:
    """The file `runs.jsonl`. Anybody may read it; rows are appended inside `appending()`.

    Attributes:
        path: where the file is, or will be.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._stream: int | None = None

    def lines(self) -> list[bytes]:
        """All lines that end. A last line without an end is torn, or is being written."""
        try:
            return self.path.read_bytes().split(b"\n")[:-1]
        except FileNotFoundError:
            return []

    def rows(self) -> list[ResultRow]:
        """Every row ever written, oldest first. Lines that are no rows are counted in a warning."""
        rows = [row_of(line) for line in self.lines()]
        bad = sum(row is None for row in rows)
        if bad:
            _log.warning("%s: %d damaged lines left out", self.path, bad)
        return [row for row in rows if row is not None]

    @contextlib.contextmanager
    def appending(self) -> Iterator[None]:
        """Hold the file open to append rows to it; a torn last line is set aside first.

        Raises:
            InputError: the disk is full.
        """
        with disk_said(self.path):
            self._set_torn_line_aside()
            self._stream = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        try:
            yield
        finally:
            os.close(self._stream)
            self._stream = None

    def _set_torn_line_aside(self) -> None:
        """Move whatever follows the last whole row to `runs.torn`, with a warning."""
        if not self.path.exists():
            return
        content = self.path.read_bytes()
        end = len(content)
        while end and not (
            content[end - 1 : end] == b"\n"
            and row_of(content[content.rfind(b"\n", 0, end - 1) + 1 : end - 1])
        ):
            end = content.rfind(b"\n", 0, end - 1) + 1
        if end == len(content):
            return
        aside = self.path.with_suffix(".torn")
        with aside.open("ab") as stream:
            stream.write(content[end:] + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        with self.path.open("r+b") as stream:
            stream.truncate(end)
            os.fsync(stream.fileno())
        _log.warning(
            "%s: the last line was torn (%d bytes); it is set aside in %s and its cell runs again",
            self.path,
            len(content) - end,
            aside.name,
        )

    def append(self, row: ResultRow) -> None:
        """Write a row at the end of the file, onto the disk: all of it or nothing.

        Raises:
            InputError: the disk is full.
            RuntimeError: the file is not held open by `appending()`.
        """
        if self._stream is None:
            raise RuntimeError("a row is appended inside appending() only")
        line = json.dumps(fields_of(row)).encode() + b"\n"
        before = os.fstat(self._stream).st_size
        with disk_said(self.path):
            try:
                _write_whole(self._stream, line)
            except OSError:
                os.ftruncate(self._stream, before)
                raise


def _write_whole(stream: int, line: bytes) -> None:
    """Write a line in one write, and put it onto the disk."""
    if os.write(stream, line) != len(line):
        raise OSError(errno.ENOSPC, "short write")
    os.fsync(stream)
