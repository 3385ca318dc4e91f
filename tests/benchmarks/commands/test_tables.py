"""Tables for terminals of any width."""

import io

import pytest
from rich.console import Console
from rich.table import Table

from benchmarks.commands.tables import entries, print_table


def shown(table) -> list[str]:
    console = Console(width=60, file=io.StringIO())
    console.print(entries(table))
    return [line.rstrip() for line in console.file.getvalue().splitlines()]


def test_short_facts_stand_beside_the_name_and_long_ones_below():
    table = Table("name", "first", "second", "third")
    table.add_row("one", "1", "2", "x" * 21)
    table.add_row("two", "", "[b]", "y")
    table.add_row("three", "", "", "")
    assert shown(table) == [
        "one   first: 1; second: 2",
        "    third: " + "x" * 21,
        "two   second: [b]",
        "    third: y",
        "three",
    ]


def test_twenty_letters_are_short():
    table = Table("name", "first")
    table.add_row("one", "x" * 20)
    assert shown(table) == ["one   first: " + "x" * 20]


def test_a_pipe_gets_a_title_headings_and_a_line_for_each_row(
    capsys: pytest.CaptureFixture[str],
) -> None:
    table = Table("name", "first", title="All")
    table.add_row("one", "1")
    table.add_row("two", "")
    print_table(table)
    assert capsys.readouterr().out == "All\nname\tfirst\none\t1\ntwo\t\n"
