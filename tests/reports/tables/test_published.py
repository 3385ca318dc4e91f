import dataclasses

import pytest

from reports.contents import contents
from reports.tables.published import claim_text, published_values, verdicts

from ..conftest import DEVIL, HAND, NEFERTITI


def test_published_values_and_claims():
    assert published_values(HAND) == {"SLIM": 0.609, "ParaPoint": 0.182, "FAM": 0.145}
    assert claim_text(DEVIL) == "stand-in"
    assert published_values("camel_b") == {}
    assert published_values("/my/own.obj") == {}
    assert claim_text("/my/own.obj") == ""


def test_only_the_published_energy_is_judged(results):
    judged = {(v.case, v.label.short) for v in verdicts(contents(results)[0])}
    assert judged == {
        (HAND, "SLIM symmetric Dirichlet"),
        (HAND, "ParaPoint"),
        (DEVIL, "SLIM symmetric Dirichlet"),
        (DEVIL, "ParaPoint"),
        (NEFERTITI, "ParaPoint"),
    }


@pytest.mark.parametrize(
    ("claim", "measured", "text"),
    [
        ("likely", 0.65, "agrees"),
        ("likely", 0.70, "higher (worse)"),
        ("same model", 0.50, "lower (better)"),
        ("stand-in", 0.609, "none: stand-in"),
    ],
)
def test_verdicts(results, claim, measured, text):
    verdict = verdicts(contents(results)[0])[0]
    verdict = dataclasses.replace(verdict, claim=claim, measured=measured, published=0.609)
    assert verdict.text == text


def test_how_a_published_figure_was_got_is_said(results):
    verdict = verdicts(contents(results)[0])[0]
    verdict = dataclasses.replace(verdict, claim="likely", measured=1.0, note="cut by hand")
    assert verdict.text == "higher (worse); published: cut by hand"
