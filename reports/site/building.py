"""The static site: an index, a page for each method and each model, and what moved in between.

It is made of several results folders, the oldest first. Of a cell that several have, the newest is
shown; the history compares each folder with the last one before it that shares cells with it. Maps
are there as the viewer reads them, quantised, and pictures are small and load when they are seen.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.store import measuring, merging
from benchmarks.store.results import Store
from parapoint.errors import InputError
from reports import citing
from reports.contents import contents
from reports.history.comparison import Comparison
from reports.history.pages import said
from reports.history.tables import alone, by_metric, ended, moved, summary
from reports.page import pages
from reports.page.sections import Section
from reports.pictures import drawing as pictures
from reports.pictures.names import slug
from reports.progress import QUIET, Progress
from reports.report import claim
from reports.site import methods
from reports.tables import formats
from reports.tables import suites as tables

LARGEST = 100e6
"""Bytes that a site may have: what the pages of a repository should hold."""


@dataclass(frozen=True)
class Built:
    """A site.

    Attributes:
        index: its first page.
        size: bytes of all its files.
        cells: how many cells it shows.
    """

    index: Path
    size: int
    cells: int


def build(sources: Sequence[Path], out: Path, *, jobs: int, progress: Progress = QUIET) -> Built:
    """Write the site of some results folders or published archives, the oldest first, to `out`.

    What has not changed since the site was last built is not drawn again.

    Raises:
        InputError: a source holds no results, they hold different versions of a suite, or something
            that is not ours is in the way of the site.
    """
    with _folders(sources) as (folders, joined):
        suites = [dataclasses.replace(suite, is_large=True) for suite in contents(joined)]
        claim(out)
        sections = []
        for suite in suites:
            made = tables.tables(suite)
            name = slug(suite.suite)
            formats.write([*made, tables.everything(suite)], out / "tables" / name)
            faults = pictures.draw(suite, out / "figures" / name / "pictures", jobs, progress)
            results = Path("results") / suite.suite
            sections.append(Section(out, suite, made, (), faults, results))
        citing.write(out, suites)
        links = methods.write(out, sections)
        links += [("history", address) for address in _history(sources, folders, out)]
        index = pages.write(out, "results", sections, links)
        cells = sum(len(suite.rows) for suite in suites)
    size = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
    return Built(index, size, cells)


@contextmanager
def _folders(sources: Sequence[Path]) -> Iterator[tuple[list[Path], Path]]:
    """Each source as a folder, archives opened; and all of them joined, the newest cells first."""
    with TemporaryDirectory(prefix="parapoint-site-") as name:
        folders = []
        for number, source in enumerate(sources):
            folder = source
            if not source.is_dir():
                folder = Path(name) / str(number) / source.stem
                merging.merge([source], folder)
            folders.append(folder)
        joined = Path(name) / "joined"
        merging.merge(folders[::-1], joined)
        _hand_on_metrics(folders, Store(joined))
        yield folders, joined


def _hand_on_metrics(folders: Sequence[Path], joined: Store) -> None:
    """Compute only those metrics of the joined results that no folder knows already."""
    known: dict[str, dict[str, float]] = {}
    for folder in folders:
        known |= measuring.values_by_key(measuring.stored_table(Store(folder)))
    keys = measuring.metrics_keys(joined, joined.rows())
    measuring.metrics(joined, {row: known[key] for row, key in keys.items() if key in known})


def _history(sources: Sequence[Path], folders: Sequence[Path], out: Path) -> list[str]:
    """Write what moved between the sources; the address of its page, if any cell is shared."""
    made, leads = [], []
    for number, after in enumerate(folders):
        for earlier in range(number)[::-1]:
            names = (sources[earlier].name, sources[number].name)
            found = Comparison(folders[earlier], after, names)
            if not found.shared:
                continue
            parts = [by_metric(found), summary(found), moved(found), ended(found), alone(found)]
            title = " to ".join(names)
            leads.append(f"{title}: {said(found)}")
            made += [
                dataclasses.replace(
                    table, title=f"{title}: {table.title}", name=f"{number}-{table.name}"
                )
                for table in parts
                if table is not None
            ]
            break
    if not made:
        return []
    folder = out / "history"
    formats.write(made, folder)
    page = formats.html("What moved between versions", made, " ".join(leads))
    (folder / "index.html").write_text(page, encoding="utf-8")
    return ["history/index.html"]


def check_size(built: Built) -> None:
    """Check that a site is not too large for the pages of a repository.

    Raises:
        InputError: it is.
    """
    if built.size > LARGEST:
        raise InputError(
            f"{built.index.parent} has {built.size / 1e6:.0f} MB, more than {LARGEST / 1e6:.0f}: "
            "give fewer folders"
        )
