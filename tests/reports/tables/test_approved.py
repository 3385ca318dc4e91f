"""The tables of small suites as a reader sees them, word by word.

`tests/golden/tables` holds them; the numbers in them are checked elsewhere, by hand.
"""

import pytest

from reports.tables import formats
from reports.tables.suites import tables

from ..approving import check
from ..small_suites import ablation, baked, varied


@pytest.mark.parametrize("suite", [varied, ablation, baked], ids=lambda suite: suite.__name__)
def test_tables_read_as_approved(suite, tmp_path):
    made = suite(tmp_path / "results")
    shown = tables(made)
    check(f"tables/{suite.__name__}.md", "\n".join(map(formats.markdown, shown)), tmp_path)
    if suite is ablation:
        check("tables/ablation.tex", "\n".join(map(formats.latex, shown)), tmp_path)
        check("tables/ablation.html", formats.html("Ablation", shown, "Two models."), tmp_path)
