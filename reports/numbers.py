"""How a number is printed: the same in every table, figure and page."""

from __future__ import annotations

import math

DASH = "–"
"""Stands where there is no value."""

LARGE = 1e5
"""Numbers from here on are printed with a power of ten."""

SIGNIFICANT = 6
"""Most digits of a number: of a larger one fewer stand after the point."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def printed(value: float | None, digits: int, *, percent: bool = False) -> str:
    """A value with `digits` after the point, a fraction as per cent if asked.

    A value that would round to 0 without being 0 is printed as "<" and the smallest step.
    """
    if value is None or math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    number = 100 * value if percent else value
    if 0 < abs(number) < 0.5 * 10**-digits:
        bound = f"{10**-digits:.{digits}f}"
        return f"<{bound}" if number > 0 else f">−{bound}"
    if abs(number) >= LARGE:
        mantissa, exponent = f"{number:.1e}".split("e")
        power = str(int(exponent)).translate(_SUPERSCRIPTS)
        return f"{mantissa}·10{power}".replace("-", "−")
    before = len(f"{abs(number):.0f}")
    return f"{number:,.{min(digits, max(SIGNIFICANT - before, 0))}f}".replace("-", "−")
