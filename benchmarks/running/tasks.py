"""What the processes of a run say to each other, and what an executor is given to do.

The run hands each executor tasks; the executor sends the job of a task to a supervisor
(`benchmarks.running.worker`), which runs it in a child process and sends an outcome back. Between
processes every message is one line of JSON. `to_json` alone writes such lines, and `from_json`
alone reads them: what it returns has every field checked.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

from benchmarks.store.records import fields_of, from_fields, loaded
from benchmarks.store.rows import Status

Tick = Callable[[], None]


@dataclass(frozen=True)
class Message:
    """Base of what the processes of a run say to each other."""


@dataclass(frozen=True, kw_only=True)
class Job(Message):
    """What every job has.

    Attributes:
        surface: the npz file of the surface.
        reference: the npz file of the map that the model came with; None if it came with none.
        time_limit: wall time that the job may take, in seconds.
        memory_limit: resident memory that all its processes together may hold, in bytes.
        folder: where the job may write; the executor sets it.
        number: tells the job from others of its supervisor; the executor sets it.
    """

    surface: Path
    reference: Path | None = None
    time_limit: float
    memory_limit: float
    folder: Path = Path()
    number: int = 0

    @property
    def inputs(self) -> dict[str, Path]:
        """The files that the job reads, by the name of the field that says where each is."""
        reference = {} if self.reference is None else {"reference": self.reference}
        return {"surface": self.surface} | reference

    def reading(self, files: Mapping[str, Path]) -> Self:
        """The same job, with its inputs at other paths: `files`, by name as in `inputs`."""
        changes: dict[str, Any] = dict(files)
        return replace(self, **changes)

    @property
    def work(self) -> Path:
        """The working folder of the job's process."""
        return self.folder / "work"


@dataclass(frozen=True, kw_only=True)
class RunJob(Job):
    """Run one method on one surface, and write the map.

    Attributes:
        spec: the method, as `baselines.registry.method` reads it.
        seed: seed of the cell.
        source_hash: hash that the method's source must have.
        plugins: "FILE.py:Class" of each method that the run adds, the path absolute.
    """

    spec: str
    seed: int
    source_hash: str
    plugins: tuple[str, ...] = ()

    @property
    def map(self) -> Path:
        """The npz file that the map is written to."""
        return self.folder / "map.npz"


@dataclass(frozen=True, kw_only=True)
class MeasureJob(Job):
    """Compute every metric of some stored maps of one surface.

    Attributes:
        maps: the npz files of the maps.
    """

    maps: tuple[Path, ...]

    @property
    def inputs(self) -> dict[str, Path]:
        """As for every job, and the maps."""
        return super().inputs | {f"map{n}": path for n, path in enumerate(self.maps)}

    def reading(self, files: Mapping[str, Path]) -> Self:
        """As for every job."""
        maps = tuple(files[f"map{n}"] for n in range(len(self.maps)))
        return replace(self, surface=files["surface"], reference=files.get("reference"), maps=maps)


@dataclass(frozen=True)
class Ready(Message):
    """A supervisor has started and takes jobs."""


@dataclass(frozen=True)
class Prepared(Message):
    """A cell is about to run its method. It may never come to an end, so it says this before.

    Attributes:
        preprocessing: what was done to the surface.
    """

    preprocessing: str


@dataclass(frozen=True)
class Outcome(Message):
    """How a job ended.

    Attributes:
        status: as in a row.
        reason: why, unless ok: one line.
        preprocessing: what was done to the surface before the method saw it; "" for nothing.
        seconds: wall time of the method alone; None if it did not come to its end.
        cpu_seconds: processor time of the same.
        load: how busy the machine was, as in a row; None if not known.
        peak_memory_mb: peak resident memory of the job's processes, in units of 10^6 bytes.
        uv_sha256: hash of the map; "" where there is none.
        report: what the method wrote beside its result.
        metrics: the metrics of each map that a MeasureJob measured, by name.
        printed: the last lines that the method printed.
        host: name and processor of the cluster's worker; "" on the run's own machine.
        took: wall time of the whole job, in seconds.
        number: of the job; the supervisor sets it.

    Raises:
        ValueError: a time, a load or an amount of memory is negative or not finite.
    """

    status: Status
    reason: str = ""
    preprocessing: str = ""
    seconds: float | None = None
    cpu_seconds: float | None = None
    load: float | None = None
    peak_memory_mb: float | None = None
    uv_sha256: str = ""
    report: Mapping[str, object] = field(default_factory=dict)
    metrics: tuple[Mapping[str, float], ...] = ()
    printed: str = ""
    host: str = ""
    took: float = 0.0
    number: int = 0

    def __post_init__(self) -> None:
        for name in ("seconds", "cpu_seconds", "load", "peak_memory_mb", "took"):
            amount = getattr(self, name)
            if amount is not None and not 0 <= amount < math.inf:
                raise ValueError(f"Outcome.{name} cannot be {amount}")


Kind = TypeVar("Kind", bound=Message)


def to_json(message: Message) -> bytes:
    """`message` as one line that `from_json` reads."""
    return json.dumps([type(message).__name__, fields_of(message)]).encode() + b"\n"


def from_json(line: bytes, *kinds: type[Kind]) -> Kind:
    """The message in a line, every field checked.

    Args:
        line: what `to_json` wrote, or what passes for it.
        kinds: the classes of the messages that may come.

    Raises:
        ValueError: the line is no such message.
    """
    content = loaded(line)
    if not isinstance(content, list) or len(content) != 2:
        raise ValueError("a message has a name and fields")
    name, fields = content
    for kind in kinds:
        if kind.__name__ == name:
            return from_fields(kind, fields)
    raise ValueError(f"a message {name!r:.100} has no place here")


@dataclass(frozen=True)
class Task:
    """A job, and who hears of it.

    Attributes:
        job: what is to be done.
        began: called when the job starts.
        ended: called with its outcome, and with the path of its map if it wrote one.
        modules: packages that the supervisor imports before it forks, so that the job need not.
            Tasks with other modules get another supervisor: what a job finds in memory never
            depends on the jobs before it.
        interpreter: the Python that runs the job.
    """

    job: Job
    began: Callable[[], None]
    ended: Callable[[Outcome, Path], None]
    modules: tuple[str, ...] = ()
    interpreter: str = sys.executable


class Executor(Protocol):
    """Does tasks. It is a context manager: once it is left, no process of this machine remains.

    Attributes:
        threads: how many threads a cell may use.
        width: how many tasks it may do at a time where nothing is timed.
    """

    threads: int
    width: int

    def __enter__(self) -> Self:
        """Get ready."""
        ...

    def __exit__(self, *_: object) -> None:
        """End all processes and connections."""
        ...

    def run(self, tasks: Sequence[Task], jobs: int) -> None:
        """Do all tasks, `jobs` at a time."""
        ...
