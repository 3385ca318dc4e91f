"""Suites: every name in them exists."""

import dataclasses

import pytest

from baselines import registry
from benchmarks.cases import derived, models, suites
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
    expected |= {
        "artist",
        "core",
        "ablation",
        "quality",
        "seeds",
        "noise",
        "cuts",
        "neural",
        "field",
        "field300",
        "hard",
        "gpu",
        "bake",
        "drawn",
    }
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


def parameters(spec: str) -> dict[str, object]:
    """All parameters of a spec, its method's name among them."""
    name, method = registry.method(spec)
    return {"method": name, **dataclasses.asdict(method)}


def changed(spec: str, other: str) -> dict[str, object]:
    """What `other` has where it differs from `spec`."""
    before, after = parameters(spec), parameters(other)
    return {name: value for name, value in after.items() if value != before[name]}


def test_each_ablation_changes_one_option_of_the_paper_s_training():
    paper, *ablations = SUITES["ablation"].methods
    assert parameters(paper)["preset"] == "paper"
    assert [changed(paper, spec) for spec in ablations] == [
        {"distortion": "isometric"},
        {"branches": "2d"},
        {"branches": "3d"},
        {"distortion_weight": 1e-4},
        {"distortion_weight": 0},
        {"unwrap_weight": 0},
        {"cycle_weight": 0},
        {"anti_flip_weight": 0},
    ]


def test_the_gpu_has_the_paper_s_whole_budget_and_no_other_device():
    from parapoint.learned.presets import PAPER

    (spec,) = SUITES["gpu"].methods
    given = {name: value for name, value in parameters(spec).items() if value is not None}
    assert (given["preset"], given["device"]) == ("paper", "cuda")
    assert not {"points", "iterations", "time_budget"} & set(given)
    assert (PAPER.points, PAPER.iterations) == (10_000, 10_000)


def test_our_training_differs_from_the_paper_s_by_its_preset_alone():
    assert changed(*SUITES["seeds"].methods) == {"preset": "learned"}


def test_the_neural_maps_have_the_same_budget():
    assert {parameters(spec)["time_budget"] for spec in SUITES["neural"].methods} == {150.0}
    assert {parameters(spec)["subset"] for spec in SUITES["neural"].methods[2:]} == {256}


def test_one_iteration_of_slim_is_told_from_all():
    isometric, once = SUITES["paper"].methods[2:4]
    assert changed(isometric, once) == {"iterations": 1}
    assert parameters(isometric)["energy"] == "symmetric_dirichlet"


def test_a_cell_runs_once_unless_a_suite_is_about_seeds():
    several = {name: suite.seeds for name, suite in SUITES.items() if suite.seeds != (0,)}
    assert several == {"seeds": (0, 1, 2, 3, 4), "quality": (0, 1, 2)}


def test_every_reconstruction_meets_every_flattening():
    pairs = {
        (parameters(spec)["reconstruction"], parameters(spec)["flattening"])
        for spec in SUITES["noise"].methods
        if spec.startswith("meshed")
    }
    assert pairs == {
        (reconstruction, flattening)
        for reconstruction in ("poisson", "ball_pivoting")
        for flattening in ("xatlas", "lscm", "slim")
    }
    assert len(SUITES["noise"].cases) == 4 * 4
    assert sum(case.endswith("@noise=0") for case in SUITES["noise"].cases) == 4


def test_sets_are_those_of_the_registry():
    sets = {
        name: {models.registry()[case].set for case in SUITES[name].cases}
        for name in ("disk", "closed", "genus", "cad", "wild", "scans", "artist", "cuts", "core")
    }
    for name in ("disk", "closed", "genus", "cad", "wild", "scans", "artist"):
        assert sets[name] == {name}
    assert sets["cuts"] == {"artist", "closed", "genus"}
    assert sets["core"] == {"paper", "disk", "closed", "genus", "cad", "artist"}


def test_the_field_has_equal_budgets():
    budgets = [parameters(spec).get("time_budget") for spec in SUITES["field"].methods]
    assert {budget for budget in budgets if budget} == {60.0}
    assert len([budget for budget in budgets if budget]) >= 7
    assert SUITES["field"].cases == (*SUITES["paper"].cases, "camelhead")
    assert SUITES["hard"].cases == (*SUITES["wild"].cases, *SUITES["scans"].cases)
    for name, seconds in ("hard", 5), ("field300", 300):
        assert SUITES[name].methods == tuple(
            spec.replace("time_budget=60", f"time_budget={seconds}")
            for spec in SUITES["field"].methods
        )
    assert SUITES["field300"].cases == SUITES["field"].cases


def test_a_drawn_seam_is_part_of_what_makes_results_comparable(tmp_path, monkeypatch):
    before = SUITES["drawn"].digest
    other = tmp_path / "seam.txt"
    other.write_text("0 1\n")
    monkeypatch.setattr(derived, "seam_file", lambda _: other)
    assert SUITES["drawn"].digest != before


@pytest.mark.parametrize("how", ["", "@noise=0.01", "@uneven", "@smooth", "@drawn"])
def test_a_model_counts_for_what_is_made_from_it_as_well(how, monkeypatch):
    model = "nefertiti-lowres_odedstein"
    trial = suites.Suite("trial", "A trial", (model + how,), ())
    before = trial.digest
    other = dataclasses.replace(models.registry()[model], sha256="0" * 64)
    monkeypatch.setattr(suites, "registry", lambda: {model: other})
    assert trial.digest != before
