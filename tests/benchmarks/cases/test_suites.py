"""Suites: every name in them exists."""

import pytest

from baselines import registry
from benchmarks.cases import models
from benchmarks.cases.builtin import BUILTIN
from benchmarks.cases.suites import SUITES, suite
from parapoint import InputError


@pytest.mark.parametrize("name", SUITES)
def test_cases_and_methods_exist(name):
    chosen = suite(name)
    assert chosen.name == name
    assert chosen.title
    assert chosen.cases
    assert chosen.seeds
    for names in (chosen.cases, chosen.methods, chosen.seeds):
        assert len(set(names)) == len(names)
    assert [models.canonical_name(case) for case in chosen.cases] == list(chosen.cases)
    for spec in chosen.methods:
        assert registry.method(spec)[0] in registry.METHODS


def test_the_suites():
    expected = {"smoke", "builtin", "paper", "disk", "closed", "genus", "cad", "wild", "scans"}
    expected |= {"artist", "core", "ablation", "quality", "seeds", "noise", "cuts", "neural"}
    assert expected == set(SUITES)
    assert SUITES["builtin"].cases == tuple(BUILTIN)
    assert len(SUITES["paper"].cases) == 6
    assert len(SUITES["quality"].cases) == 10
    assert SUITES["quality"].seeds == (0, 1, 2)
    assert set(SUITES["paper"].cases) | set(SUITES["disk"].cases) <= set(SUITES["core"].cases)
    in_a_set = [
        case
        for name in ("disk", "closed", "genus", "cad", "wild", "scans", "artist")
        for case in SUITES[name].cases
    ]
    assert len(set(in_a_set)) == len(in_a_set) == 56


def test_an_unknown_suite_names_all():
    with pytest.raises(InputError, match="perhaps paper; there are smoke, builtin"):
        suite("papier")
