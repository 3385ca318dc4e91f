import dataclasses
import json
from types import SimpleNamespace

import pytest

from benchmarks.cases.models import registry
from reports.contents import contents
from reports.labels import Label
from reports.tables.published import (
    Verdict,
    claim_reason,
    claim_text,
    figures,
    published_values,
    verdicts,
)
from reports.tables.suites import against_published

from ..conftest import DEVIL, HAND, NEFERTITI

LABEL = Label("slim", "{}", "SLIM", "", "SLIM")


def test_published_values_and_claims():
    assert published_values(HAND) == {"SLIM": 0.609, "ParaPoint": 0.182, "FAM": 0.145}
    assert claim_text(DEVIL) == "stand-in"
    assert published_values("camel_b") == {}
    assert published_values("/my/own.obj") == {}
    assert claim_text("/my/own.obj") == ""


def test_each_figure_has_a_verdict_and_only_the_published_energy_is_judged(results):
    judged = [
        (v.case, v.figure.method, v.label.short if v.label else "")
        for v in verdicts(contents(results)[0])
    ]
    assert judged == [
        (HAND, "SLIM", "SLIM symmetric Dirichlet"),
        (HAND, "ParaPoint", "ParaPoint"),
        (HAND, "FAM", ""),
        (DEVIL, "SLIM", "SLIM symmetric Dirichlet"),
        (DEVIL, "ParaPoint", "ParaPoint"),
        (DEVIL, "FAM", ""),
        (NEFERTITI, "SLIM", "SLIM symmetric Dirichlet"),
        (NEFERTITI, "ParaPoint", "ParaPoint"),
        (NEFERTITI, "FAM", ""),
    ]


@pytest.mark.parametrize(
    ("given", "word", "why"),
    [
        ({"measured": 0.669}, "reproduced", "within 0.061"),
        ({"measured": 0.549}, "reproduced", "within 0.061"),
        ({"measured": 0.70}, "worse", "higher by 0.091"),
        ({"claim": "same model", "measured": 0.50}, "better", "lower by 0.109"),
        (
            {"measured": 0.50, "grade": "collapsed"},
            "better",
            "lower by 0.109, but our map is collapsed",
        ),
        ({"measured": 0.50, "grade": "broken"}, "not comparable", "our map is broken"),
        ({"claim": "stand-in"}, "not comparable", "our file is a stand-in"),
        ({"measured": None}, "not comparable", "there is no map here"),
        ({"label": None}, "not comparable", "the method has not run here"),
    ],
)
def test_a_verdict_and_its_reason(results, given, word, why):
    verdict = verdicts(contents(results)[0])[0]
    assert verdict.figure.value == 0.609
    usable = {"claim": "likely", "measured": 0.609, "grade": "usable"}
    verdict = dataclasses.replace(verdict, **(usable | given))
    assert (verdict.word, verdict.why) == (word, why)
    assert verdict.text == f"{word}: {why}"


def test_a_cut_by_hand_is_not_compared_with_an_automatic_one(results):
    verdict = next(v for v in verdicts(contents(results)[0]) if v.case == NEFERTITI)
    verdict = dataclasses.replace(verdict, measured=0.089, grade="usable")
    assert verdict.text == "not comparable: published: cut by hand"


@pytest.mark.parametrize(
    ("changed", "is_judged"),
    [
        ({}, True),
        ({"time_budget": 150.0, "points": 64, "subset": 64, "iterations": 9}, True),
        ({"seed": 0, "threads": 1, "device": "cpu", "components": "together"}, True),
        ({"distortion": None, "unwrap_weight": None}, True),
        ({"distortion": "isometric"}, False),
        ({"branches": "2d"}, False),
        ({"start": "computed"}, False),
        ({"optimizer": "soap"}, False),
        ({"eigenvalues": "gram"}, False),
        ({"distortion_weight": 1e-4}, False),
        ({"unwrap_weight": 0.0}, False),
        ({"cycle_weight": 0.0}, False),
        ({"anti_flip_weight": 0.0}, False),
    ],
)
def test_a_variant_of_the_published_method_has_no_verdict(changed, is_judged):
    params = json.dumps({"preset": "paper"} | changed)
    label = Label("parapoint", params, "ParaPoint", "", "ParaPoint")
    suite = SimpleNamespace(cases=[HAND], methods=[label], records={})
    judged = [v.figure.method for v in verdicts(suite) if v.label is not None]
    assert judged == (["ParaPoint"] if is_judged else [])


def test_a_broken_map_is_compared_with_no_figure(results):
    suite = contents(results)[0]
    suite.records[HAND, "ParaPoint"]["grade"] = "broken"
    told = {v.figure.method: v.text for v in verdicts(suite) if v.case == HAND}
    assert told["ParaPoint"] == "not comparable: our map is broken"
    assert told["SLIM"].startswith("better: lower by ")


def test_only_a_model_cut_along_a_drawn_seam_is_compared_with_one_cut_by_hand():
    drawn = f"{NEFERTITI}@drawn"
    assert published_values(drawn) == {"SLIM": 0.089}
    assert claim_text(drawn) == claim_text(NEFERTITI) == "likely"
    assert published_values(f"{HAND}@drawn") == {}
    (figure,) = figures(drawn)
    verdict = Verdict(drawn, "likely", figure, LABEL, 0.093, "usable")
    own = "along our own seam, as theirs is not public"
    assert verdict.text == f"reproduced: within 0.009, {own}"
    assert dataclasses.replace(verdict, measured=0.05).text == f"better: lower by 0.039, {own}"


def test_the_table_names_model_metric_unit_tolerance_trust_and_verdict(results):
    table = against_published(contents(results)[0])
    (first, *_), *_ = table.blocks
    assert first["case"] == f"{HAND} (paper: hand)"
    assert first["metric"].endswith("[radians]")
    assert first["tolerance"] == pytest.approx(0.0609)
    assert first["verdict"] == "better"
    notes = " ".join(table.notes)
    assert "ParaPoint (arXiv 2403.10349), supplement: as printed" in notes
    assert "arXiv 2405.14633): second hand" in notes
    assert f"{HAND}: {claim_reason(HAND)}" in table.notes


def test_no_figure_is_invented():
    """What the text of the paper prints, and no other."""
    printed = {
        "beetle": (0.410, 0.066),
        "fear-face": (0.635, 0.120),
        "keegan": (0.063, 0.059),
        "hand": (0.609, 0.182),
        "maxplanck": (0.307, 0.117),
        "nefertiti": (0.089, 0.124),
    }
    for model in registry().values():
        for figure in model.published:
            if "ParaPoint (arXiv" in figure.source:
                place = ("SLIM", "ParaPoint").index(figure.method)
                assert figure.value == printed[model.paper_name][place]
