"""The progress of a fit on standard error: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from parapoint.console import terminal
from parapoint.fitting import Progress


@contextmanager
def bar() -> Iterator[Callable[[Progress], None]]:
    """Gives the callback that moves the bar."""
    shown = terminal(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=20),
        TimeElapsedColumn(),
        TextColumn("{task.fields[loss]}"),
        TextColumn("{task.fields[remaining]}"),
    )
    with Bar(*columns, console=shown, disable=not shown.is_terminal) as progress:
        # While nobody can tell the end, as while a map is computed, the bar pulses.
        task = progress.add_task("start", total=None, loss="", remaining="")

        def advance(now: Progress) -> None:
            remaining = "" if now.remaining is None else f"{now.remaining:.0f} s left"
            total = None if now.fraction is None else 1.0
            progress.update(
                task,
                completed=now.fraction or 0.0,
                total=total,
                description=now.phase,
                remaining=remaining,
            )
            if now.losses:
                progress.update(task, loss=f"loss {now.losses['total']:.4f}")

        yield advance
