"""The comparison of two results folders as a reader sees it, word by word.

Maps are sheared by powers of two, so that areas which are equal are equal on every machine.
"""

from reports.history.comparison import Comparison
from reports.history.pages import said
from reports.history.tables import alone, by_metric, ended, moved, summary
from reports.tables.formats import markdown

from ..approving import check
from ..conftest import DEVIL, HAND, NEFERTITI
from .test_comparison import MACHINE, folder


def test_two_folders_read_as_approved(tmp_path):
    late = {"status": "timeout", "reason": "over 10 s"}
    before = [
        (HAND, "slim", [0.25], {"seconds": 1.0}),
        (DEVIL, "slim", [0.125], {"seconds": 4.0}),
        (NEFERTITI, "slim", [None], late),
        (HAND, "parapoint", [0.125, 0.140625, 0.15625], {"seconds": 2.0}),
        (DEVIL, "parapoint", [0.25], {"seconds": 2.0}),
        (HAND, "lscm", [0.0], {}),
        (DEVIL, "tutte", [0.2], {}),
    ]
    after = [
        (HAND, "slim", [0.3125], {"seconds": 8.0, "source_hash": "new"}),
        (DEVIL, "slim", [0.0625], {"seconds": 4.1}),
        (NEFERTITI, "slim", [0.2], {}),
        (HAND, "parapoint", [0.25, 0.265625, 0.28125], {"seconds": 2.5}),
        (DEVIL, "parapoint", [None], late),
        (HAND, "lscm", [0.0], {}),
        (HAND, "bff", [0.0], {}),
    ]
    lines = []
    for name, machine in (("same", MACHINE), ("other", MACHINE | {"cpu": "B", "cores": 4})):
        made = Comparison(
            folder(tmp_path / name / "before", *before),
            folder(tmp_path / name / "after", *after, machine=machine),
            ("old", "new"),
        )
        shown = [table(made) for table in (summary, by_metric, moved, ended, alone)]
        lines += [said(made), *(markdown(table) for table in shown if table is not None)]
    check("tables/history.md", "\n".join(lines), tmp_path)
