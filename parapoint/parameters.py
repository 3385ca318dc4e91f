"""Checks of parameters: each raises one clear line where a value is not what it has to be."""

from __future__ import annotations

import math
import numbers
from collections.abc import Collection

from parapoint.errors import InputError

LARGEST_SEED = 2**63 - 1
"""Largest seed: what torch takes and a column of a table holds."""
MOST_THREADS = 1024
"""Most threads that torch is asked for: a million of them end the process."""
LONGEST_SECONDS = 1e9
"""Largest time, in seconds, that may be asked for: some thirty years."""
LONGEST_VALUE = 200
"""Characters of a wrong value that a message shows."""
MOST_MEMORY = 1e6
"""Most memory, in GB, that may be asked for."""


def check_whole(name: str, value: object, least: int, most: int | None = None) -> None:
    """Raise InputError unless `value` is a whole number (numpy's count too) in [least, most]."""
    is_whole = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):  # type: ignore[operator]  # a whole number
        upper = "" if most is None else f" and at most {most}"
        raise InputError(
            f"{name} must be a whole number of at least {least}{upper}, not {_said(value)}"
        )


def _said(value: object) -> str:
    """A value as a message shows it. Python spells out no number of thousands of digits."""
    try:
        text = repr(value)
    except ValueError:
        return "one of thousands of digits"
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def check_choice(name: str, value: object, choices: Collection[str]) -> None:
    """Raise InputError unless `value` is one of `choices`."""
    if not isinstance(value, str) or value not in choices:
        raise InputError(f"{name} must be one of {', '.join(choices)}, not {_said(value)}")


def check_number(
    name: str, value: object, least: float = 0.0, most: float = math.inf, *, above: bool = False
) -> None:
    """Raise InputError unless `value` is a finite number in [least, most].

    Args:
        name: what the message calls the value.
        value: what is checked.
        least: lower bound.
        most: upper bound; none by default.
        above: whether `least` itself is refused.
    """
    is_number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    try:
        number = float(value) if is_number else math.nan  # type: ignore[arg-type]  # a number
    except OverflowError:  # a whole number beyond all floats
        number = math.inf
    fits = math.isfinite(number) and least <= number <= most and not (above and number == least)
    if not fits:
        bound = f"above {least:g}" if above else f"of at least {least:g}"
        upper = "" if math.isinf(most) else f" and at most {most:g}"
        raise InputError(f"{name} must be a number {bound}{upper}, not {_said(value)}")
