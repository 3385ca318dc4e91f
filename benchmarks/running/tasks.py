"""Tasks of a run, and what works them off."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

Outcome = dict[str, Any]
Tick = Callable[[], None]


@dataclass(frozen=True)
class Task:
    """Something for a supervisor to do.

    Attributes:
        job: what the supervisor is told, its limits included.
        inputs: the files that it reads, by the name under which it is told where each is.
        began: called when it is under way.
        ended: called with its outcome, the last lines printed and the file it may have written.
        modules: what its supervisor has imported before, so that the task need not. Another set of
            them, another supervisor: what a task finds in memory is not up to those before it.
    """

    job: Mapping[str, Any]
    inputs: Mapping[str, Path]
    began: Callable[[], None]
    ended: Callable[[Outcome, str, Path], None]
    modules: tuple[str, ...] = ()


class Executor(Protocol):
    """Works off tasks. A context manager: after it, no process of this machine is left.

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
