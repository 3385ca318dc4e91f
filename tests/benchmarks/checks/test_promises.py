import pytest

from benchmarks.checks.promises import repeats


@pytest.mark.parametrize(
    ("method", "params", "expected"),
    [
        ("slim", {"energy": "conformal", "iterations": 20}, True),
        ("mean_value", {}, True),
        ("abf", {}, True),
        ("geometry_image", {}, True),
        ("seamster", {}, True),
        ("automatic+slim", {}, True),
        ("computed", {}, True),
        ("computed", {"time_budget": 1.0}, False),  # the clock decides
        ("uvatlas", {}, False),  # it has random numbers of its own
        ("parapoint", {"iterations": 5, "device": "cpu"}, False),  # torch, with as many threads
        ("slim", {"energy": "older"}, False),
        ("slim", {"gone": 1}, False),
        ("mine", {}, False),
        ("<script>", {"<b>": "'"}, False),
    ],
)
def test_a_method_repeats_itself_where_it_promises_to(method, params, expected):
    assert repeats(method, params) is expected
