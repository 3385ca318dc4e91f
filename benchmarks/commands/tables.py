"""Tables as commands print them."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rich.console import Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from parapoint.console import terminal

SHORT = 20
"""Characters of a fact that shares a line with others on a terminal."""


def print_table(table: Table, drawn: Callable[[Table], RenderableType] | None = None) -> None:
    """Print a table: drawn on a terminal, and as tab-separated lines anywhere else.

    Args:
        table: the table.
        drawn: makes of it what a terminal shows; the table itself if None.
    """
    console = terminal()
    if console.is_terminal:
        console.print(table if drawn is None else drawn(table))
        return
    if table.title:
        print(table.title)
    print("\t".join(str(column.header) for column in table.columns))
    cells = [[str(cell) for cell in column.cells] for column in table.columns]
    for line in zip(*cells, strict=True):
        print("\t".join(line))
    sys.stdout.flush()


def entries(table: Table) -> Group:
    """A table as a terminal of any width can show it: an entry for each row, under its name.

    Short facts share the first line with the name; each long one has lines of its own.
    """
    headings = [str(column.header) for column in table.columns]
    rows = list(
        zip(*([str(cell) for cell in column.cells] for column in table.columns), strict=True)
    )
    is_long = [max(map(len, cells), default=0) > SHORT for cells in zip(*rows, strict=True)]
    shown: list[Text | Padding] = []
    for name, *facts in rows:
        named = [
            Text.assemble((f"{heading}: ", "dim"), fact)
            for heading, fact in zip(headings[1:], facts, strict=True)
        ]
        short = [
            text
            for text, fact, long in zip(named, facts, is_long[1:], strict=True)
            if fact and not long
        ]
        shown.append(Text.assemble((name, "bold"), "   " * bool(short), Text("; ").join(short)))
        shown += [
            Padding(text, (0, 0, 0, 4))
            for text, fact, long in zip(named, facts, is_long[1:], strict=True)
            if fact and long
        ]
    return Group(*shown)
