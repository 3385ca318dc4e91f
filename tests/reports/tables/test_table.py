import math

import pytest

from reports.tables.table import Column, Table, metric_column

COLUMNS = (
    Column("name", "Name", text=True, once=True),
    Column("a", "A", better="lower", digits=2, group="G"),
    Column("b", "B", better="higher", digits=1, percent=True, group="G"),
    Column("c", "C", digits=0),
)


def table(*rows, **given):
    return Table("t", "T", "C_1", COLUMNS, (rows,), **given)


def marks(made):
    return [[cell.mark for cell in row] for block in made.cells for row in block]


def test_best_and_second_by_direction_and_ties_by_what_is_printed():
    made = table(
        {"name": "x", "a": 0.101, "b": 0.1, "c": 1.0},
        {"name": "x", "a": 0.10, "b": 0.5, "c": 2.0},
        {"name": "x", "a": 0.2, "b": 0.3, "c": 3.0},
        {"name": "x", "a": 0.3, "b": None, "c": 3.0},
        {"name": "x", "a": math.inf, "b": math.nan, "c": 3.0},
    )
    assert marks(made) == [
        ["", "best", "", ""],
        ["", "best", "best", ""],
        ["", "", "second", ""],  # in "a" two share the first place, so this one is third
        ["", "", "", ""],
        ["", "", "", ""],
    ]


def test_a_method_set_apart_is_not_ranked():
    rows = [{"label": "atlas", "a": 0.1}, {"label": "p", "a": 0.2}, {"label": "q", "a": 0.3}]
    assert [row[1] for row in marks(table(*rows, set_apart=frozenset({"atlas"})))] == [
        "",
        "best",
        "second",
    ]


def test_ranks_across_a_row():
    columns = tuple(Column(key, key, better="lower") for key in "abc")
    made = Table("t", "T", "C", columns, (({"a": 3.0, "b": 1.0, "c": 2.0},),), across=True)
    assert marks(made) == [["", "best", "second"]]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"),
        (math.nan, "–"),
        (math.inf, "∞"),
        (-math.inf, "−∞"),
        (0.0, "0.00"),
        (0.004, "<0.01"),
        (-1.5, "−1.50"),
        (1234.5, "1,234.50"),
        (2.5e7, "2.5·10⁷"),
        ("failed", "failed"),
    ],
)
def test_printed_values(value, text):
    assert COLUMNS[1].shown(value) == text


def test_a_fraction_is_shown_as_per_cent():
    assert COLUMNS[2].shown(0.1234) == "12.3"


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("seconds", "12.35"),
        ("angle_difference_mean", "12.3457"),  # radians
        ("chart_count", "12.3"),  # a mean over models, so not always whole
        ("quasi_conformal_mean", "12.346"),
        ("flipped_fraction", "1,234.57"),  # per cent
    ],
)
def test_metrics_have_the_digits_of_their_kind(name, text):
    assert metric_column(name).shown(12.34567) == text
