"""A whole report: what is written where."""

from __future__ import annotations

from pathlib import Path

from reports import figures, formats, pictures, tables
from reports.contents import contents
from reports.page import Section, page


def write(folder: Path, *, jobs: int) -> Path:
    """Write the report on the results in `folder` to `folder`/report; the path of its page.

    report/tables/SUITE/*.tex, .md, .csv; report/figures/SUITE/*.pdf, .png, captions.md and
    pictures/; report/index.html. What has not changed is not drawn again.

    Raises:
        InputError: the folder is missing, holds no results, or is of a newer version.
    """
    report = folder / "report"
    sections = []
    for suite in contents(folder):
        made = tables.tables(suite)
        name = pictures.slug(suite.suite)
        formats.write([*made, tables.everything(suite)], report / "tables" / name)
        drawn_in = report / "figures" / name
        faults = pictures.draw(suite, drawn_in / "pictures", jobs)
        drawn = figures.draw(suite, drawn_in / "pictures", drawn_in, jobs)
        sections.append(Section(suite, made, drawn, faults))
    index = report / "index.html"
    index.write_text(page(folder, sections), encoding="utf-8")
    return index
