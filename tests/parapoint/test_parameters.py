"""Bounds of parameters: what lies on them passes, what lies beyond is named."""

import numpy as np
import pytest

from parapoint.errors import InputError
from parapoint.parameters import check_choice, check_number, check_whole


@pytest.mark.parametrize("value", [3, 5, 7, np.int64(3), np.uint8(7)])
def test_whole_numbers_within_their_bounds_pass(value):
    check_whole("n", value, 3, 7)
    check_whole("n", value, 3)


@pytest.mark.parametrize("value", [2, 8, -5, 4.0, "4", None, True, np.float64(5)])
def test_others_are_named_with_both_bounds(value):
    with pytest.raises(InputError, match=r"^n must be a whole number of at least 3 and at most 7"):
        check_whole("n", value, 3, 7)


def test_without_an_upper_bound_none_is_told():
    check_whole("n", 10**30, 0)
    with pytest.raises(InputError, match=r"^n must be a whole number of at least 1, not 0$"):
        check_whole("n", 0, 1)


@pytest.mark.parametrize("value", [0, 0.0, 0.5, 1, np.float32(0.25)])
def test_numbers_within_their_bounds_pass(value):
    check_number("x", value, 0, 1)


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan, np.inf, True, "1", None, 1j])
def test_numbers_beyond_are_named(value):
    with pytest.raises(InputError, match=r"^x must be a number of at least 0 and at most 1, not"):
        check_number("x", value, 0, 1)


def test_a_number_above_a_bound_is_not_the_bound():
    check_number("x", 1e-300, above=True)
    check_number("x", 1e300)
    with pytest.raises(InputError, match=r"^x must be a number above 0, not 0$"):
        check_number("x", 0, above=True)
    with pytest.raises(InputError, match=r"^x must be a number above 2 and at most 3, not 2$"):
        check_number("x", 2, 2, 3, above=True)
    for value in (np.inf, -np.inf):
        with pytest.raises(InputError, match="must be a number"):
            check_number("x", value)


@pytest.mark.parametrize("digits", [400, 5000])
def test_numbers_of_any_length_are_named(digits):
    value = 10**digits
    for check in (check_whole, check_number):
        with pytest.raises(InputError, match=r"^x must be") as error:
            check("x", value, 0, 7)
        assert len(str(error.value)) < 300
    with pytest.raises(InputError, match=r"^x must be one of a"):
        check_choice("x", value, ("a",))


def test_choices_are_told():
    check_choice("kind", "a", ("a", "b"))
    with pytest.raises(InputError, match=r"^kind must be one of a, b, not 'c'$"):
        check_choice("kind", "c", ("a", "b"))
