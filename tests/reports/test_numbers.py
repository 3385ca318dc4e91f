import math

import pytest

from reports.numbers import printed


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (None, 2, "–"),
        (math.nan, 2, "–"),
        (math.inf, 2, "∞"),
        (-math.inf, 2, "−∞"),
        (0.0, 3, "0.000"),
        (0.0004, 3, "<0.001"),
        (0.0006, 3, "0.001"),
        (-0.0004, 3, ">−0.001"),
        (-1.5, 1, "−1.5"),
        (99_999.0, 0, "99,999"),
        (100_000.0, 0, "1.0·10⁵"),
        (-2.5e12, 0, "−2.5·10¹²"),
        (12_345.678, 3, "12,345.7"),  # six digits and no more
        (99_999.6, 1, "100,000"),
    ],
)
def test_numbers(value, digits, text):
    assert printed(value, digits) == text


def test_fractions_as_per_cent():
    assert printed(0.1234, 1, percent=True) == "12.3"
    assert printed(0.00001, 2, percent=True) == "<0.01"
