"""A whole report: what is written where."""

from __future__ import annotations

from pathlib import Path

from benchmarks.running.scratch import MARK
from parapoint.errors import InputError
from reports import citing
from reports.contents import contents
from reports.page import pages as page
from reports.page.sections import Section
from reports.pictures import drawing as pictures
from reports.pictures import exports, figures
from reports.pictures.names import slug
from reports.progress import QUIET, Progress
from reports.tables import formats
from reports.tables import suites as tables


def write(folder: Path, *, jobs: int, textured: bool = False, progress: Progress = QUIET) -> Path:
    """Write the report on the results in `folder` to `folder`/report; the path of its index.

    report/tables/SUITE/*.tex, .md, .csv; report/figures/SUITE/*.pdf, .png, captions.md and
    pictures/; report/methods.bib; report/index.html, report/models/SUITE/MODEL.html and what they
    share in report/assets/; if `textured`, report/exports/SUITE/MODEL/*.obj, .mtl, .png, .glb.
    What has not changed is not drawn again. `progress` hears how it goes.

    Raises:
        InputError: the folder is missing, holds no results, or is of a newer version; something
            that no report has written is in the way.
    """
    report = folder / "report"
    sections = []
    suites = contents(folder)
    claim(report)
    for suite in suites:
        made = tables.tables(suite)
        name = slug(suite.suite)
        formats.write([*made, tables.everything(suite)], report / "tables" / name)
        drawn_in = report / "figures" / name
        faults = pictures.draw(suite, drawn_in / "pictures", jobs, progress)
        drawn = figures.draw(suite, drawn_in / "pictures", drawn_in, jobs, progress)
        if textured:
            faults += exports.write(suite, report, progress)
        sections.append(Section(report, suite, made, drawn, faults, folder))
    citing.write(report, suites)
    return page.write(report, str(folder), sections)


def claim(report: Path) -> None:
    """Make the folder of a report or a site, marked as ours.

    Raises:
        InputError: there is something that is not ours.
    """
    mark = report / MARK
    is_free = not report.exists() or (report.is_dir() and not any(report.iterdir()))
    if report.is_symlink() or not (is_free or mark.is_file()):
        raise InputError(f"{report}: is in the way and not known to be ours; move it")
    report.mkdir(parents=True, exist_ok=True)
    mark.touch()
