"""How far a report is: a bar on a terminal, and anywhere else a line for each of its parts."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as Bar

from parapoint.console import terminal

Item = TypeVar("Item")
SILENCE = 60.0
"""Seconds after which a report says that it goes on, where no terminal shows it."""


class Progress:
    """What a report tells while it is written. This one says nothing; a subclass does."""

    def track(self, items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
        """The items, told one by one as they come.

        Args:
            items: what a part of the report makes, or is made of.
            what: the part, such as "smoke: pictures".
            total: how many items there are.
        """
        del what, total
        yield from items


QUIET = Progress()
"""Says nothing."""


class Shown(Progress):
    """Tells of a report on standard error."""

    def track(self, items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
        """As the base, with a bar or with lines; nothing where there is no item."""
        if not total:
            yield from items
            return
        console = terminal(stderr=True)
        if not console.is_terminal:
            yield from _lines(items, what, total)
            return
        columns = (TextColumn("{task.description}"), BarColumn(20), MofNCompleteColumn())
        times = (TimeElapsedColumn(), TimeRemainingColumn())
        with Bar(*columns, *times, console=console, transient=True) as bar:
            yield from bar.track(items, total=total, description=what)


def _lines(items: Iterable[Item], what: str, total: int) -> Iterator[Item]:
    """The items, with a line at the end, and one a minute before."""
    began = said = time.monotonic()
    for done, item in enumerate(items, start=1):
        yield item
        now = time.monotonic()
        if done == total or now - said >= SILENCE:
            print(f"{what} {done}/{total} ({now - began:.0f} s)", file=sys.stderr, flush=True)
            said = now
