"""The result store of a run: rows, maps, surfaces, environment, metrics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Status = Literal["ok", "skipped", "failed", "timeout", "out_of_memory"]


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
        surface_hash: hash of the surface as loaded; names `surfaces/<hash>.npz`.
        status: how it ended.
        reason: why, unless ok: one line.
        output: last lines of what the method printed, kept where it did not end well.
        preprocessing: what was done to the surface before the method saw it ("" for nothing).
        seconds: wall time of `parameterize` alone.
        cpu_seconds: processor time of the same.
        peak_memory_mb: peak resident memory of the cell's process.
        uv_file: `uv/<id>.npz`, or "" where there is no map.
        uv_sha256: hash of that file.
        report: what the method wrote beside its result (energies, iterations, weights).
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
