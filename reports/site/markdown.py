"""The reference results as one page of Markdown: docs/RESULTS.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from parapoint.errors import InputError
from parapoint.files.targets import complete_file
from reports.contents import Contents, contents, suite_title
from reports.tables import formats
from reports.tables import suites as tables
from reports.tables.notes import load_notes, version_notes

TOLD = (
    "methods",
    "bakes",
    "overall",
    "success",
    "conformality",
    "published",
    "kinds",
    "cuts",
    "seeds",
)
"""Names of the tables on the page, of those that a suite has."""
LONG = frozenset({"conformality", "cuts"})
"""Those with a value for every method on every model."""
FEW = 12
"""Methods of a suite up to which the page has its LONG tables; the site always has them."""
MARK = "<!-- Written by `python -m reports markdown`: "
"""How the page begins; a page that does not is not overwritten."""
ABOUT = (
    "`python -m reports markdown DIR --out docs/RESULTS.md` renews the sections of the suites in a "
    "results folder and keeps the others. Each names the commit and the machine of its run. "
    "Validity comes before rank (METRICS.md, *Grades*)."
)
"""What stands above the sections."""
SECTION = re.compile(
    r"^## [^\n]* \(`([^`\n]+)`\)\n.*?(?=^## [^\n]* \(`[^`\n]+`\)$|\Z)", re.MULTILINE | re.DOTALL
)
"""A suite's section on the page; the group is the suite's name."""


def write(sources: Sequence[Path], out: Path) -> Path:
    """Write the page, or renew the sections of some suites on it; its path.

    The sections of other suites stay as they are, since a run of all suites takes a day.

    Raises:
        InputError: a folder holds no results; `out` is there and not ours.
    """
    before = out.read_text(encoding="utf-8", errors="replace") if out.exists() else MARK
    if not before.startswith(MARK):
        raise InputError(f"{out}: is in the way and not ours; take another --out")
    suites = [suite for source in sources for suite in contents(source)]
    sections = _sections(before) | {suite.suite: "\n\n".join(_suite(suite)) for suite in suites}
    parts = [f"{MARK}change the results, not this page. -->", "# Reference results", ABOUT]
    parts += sections.values()
    out.parent.mkdir(parents=True, exist_ok=True)
    with complete_file(out) as stream:
        stream.write(("\n\n".join(parts) + "\n").encode())
    return out


def _sections(page: str) -> dict[str, str]:
    """The text of each suite's section on a page, by the suite's name."""
    return {head[1]: head[0].strip() for head in SECTION.finditer(page)}


def _suite(suite: Contents) -> list[str]:
    """The paragraphs of a suite: its tables, and what must be known of its run."""
    told = set(TOLD) if len(suite.methods) <= FEW else set(TOLD) - LONG
    made = [table for table in tables.tables(suite) if table.name in told]
    loads = [row.load for row in suite.rows if row.load is not None]
    load = f"Load while cells ran: {min(loads):.1f} to {max(loads):.1f}." if loads else ""
    maps = sum(row.status == "ok" for row in suite.rows)
    about = (
        f"{len(suite.methods)} methods on {len(suite.cases)} models: {len(suite.rows)} cells, "
        f"{maps} maps. {load}"
    )
    return [
        f"## {suite_title(suite.suite)} (`{suite.suite}`)",
        " ".join([about.strip(), *version_notes(suite), *load_notes(suite)]),
        *(formats.markdown(table).strip() for table in made),
    ]
