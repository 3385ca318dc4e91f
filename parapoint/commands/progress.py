"""The progress of a command on standard error: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from rich.progress import BarColumn, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.text import Text

from parapoint.console import terminal
from parapoint.fitting import Progress

Tell = Callable[[Progress], None]
"""What a part of a command calls to say how far it is."""


def untold(_: Progress) -> None:
    """What is called where nobody looks."""


def baking(tell: Tell) -> Callable[[float], None]:
    """What a bake calls with the share that is done, from 0 to 1."""
    tell(Progress("baking"))
    return lambda share: tell(Progress("baking", share))


@contextmanager
def bar() -> Iterator[Tell]:
    """Gives the callback that moves the bar.

    Log lines and warnings stand above it: while it is there, rich takes what goes to standard
    error. Where a phase tells its share but not its end, the end is reckoned from its start.
    """
    shown = terminal(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TimeElapsedColumn(),
        TextColumn("{task.fields[loss]}"),
        _TimeLeft(),
    )
    with Bar(*columns, console=shown, disable=not shown.is_terminal) as progress:
        # While nobody can tell the end, as while a map is computed, the bar pulses.
        task = progress.add_task("start", total=None, loss="", end=None)
        phase, begun = "", 0.0

        def advance(now: Progress) -> None:
            nonlocal phase, begun
            if now.phase != phase:
                phase, begun = now.phase, monotonic()
                progress.update(task, loss="")
            remaining = now.remaining
            if remaining is None and now.fraction:
                remaining = (monotonic() - begun) * (1 - now.fraction) / now.fraction
            drawn = progress.tasks[0]
            # `update` would keep the total where none is given, and the time where a phase ended.
            drawn.total, drawn.finished_time = None if now.fraction is None else 1.0, None
            progress.update(
                task,
                completed=now.fraction or 0.0,
                description=now.phase,
                end=None if remaining is None else monotonic() + remaining,
            )
            if now.losses:
                progress.update(task, loss=f"loss {now.losses['total']:.4f}")

        yield advance


class _TimeLeft(ProgressColumn):
    """The seconds to the time at which a task is thought to end, where there is one."""

    def render(self, task: Task) -> Text:
        end: float | None = task.fields["end"]
        return Text("" if end is None else f"{max(0.0, end - monotonic()):.0f} s left")
