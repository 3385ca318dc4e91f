"""`python -m benchmarks publish | merge | verify | submit`: results that travel."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path

import click

from benchmarks.cases import suites
from benchmarks.running import environment, scoring
from benchmarks.running.expectation import clock
from benchmarks.store import measuring, merging, publishing, recomputing, submissions, versions
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.console import LONGEST_MESSAGE, printable

LISTED = 20
"""Number of lines of one kind that are printed; of any others only the number is given."""
PATH = click.Path(path_type=Path)


def _say(line: str) -> None:
    print(printable(line, LONGEST_MESSAGE), flush=True)


def _say_all(lines: list[str], more: str) -> None:
    """Print the first LISTED of some lines, and how many `more` there are."""
    for line in lines[:LISTED]:
        _say(line)
    if len(lines) > LISTED:
        print(f"and {len(lines) - LISTED} more {more}")


class _Told:
    """Says on standard error how many maps have been measured: at most every ten seconds."""

    def __init__(self) -> None:
        self.began = self.said = time.monotonic()

    def __call__(self, done: int, total: int) -> None:
        now = time.monotonic()
        if total and (done == total or now - self.said >= 10):
            self.said = now
            print(f"measured {done}/{total} ({clock(now - self.began)})", file=sys.stderr)


@click.command(no_args_is_help=True)
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--out", type=PATH, metavar="ARCHIVE.zip", help="[default: DIR.zip]")
def publish(folder: Path, out: Path | None) -> None:
    """Write a results folder into one sealed archive.

    It holds rows, maps, metrics, environment and hashes. A second time gives the same bytes. Rows
    of your own files are left out.
    """
    archive = folder.resolve().with_name(f"{folder.resolve().name}.zip") if out is None else out
    found = publishing.publish(folder, archive)
    size = archive.stat().st_size / 1e6
    _say(f"{archive}: {found.rows} rows, {found.maps} maps, {size:.1f} MB")
    if found.own:
        _say(f"left out: {found.own} rows of files that are not public")
    _say(f"check it: {shlex.join(['python', '-m', 'benchmarks', 'verify', str(archive)])}")


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --out C")
@click.argument("sources", metavar="A B ...", nargs=-1, required=True, type=PATH)
@click.option("--out", metavar="C", required=True, type=PATH, help="A new folder.")
def merge(sources: tuple[Path, ...], out: Path) -> None:
    """Join results folders and archives into a new folder.

    Where two answer the same cell in another way, the one that is named first stays.
    """
    found = merging.merge(sources, out)
    same = f", {found.same} of them in several alike" if found.same else ""
    _say(f"{out}: {found.rows} rows{same}")
    kept = [f"the first answer stays: {line} has another" for line in found.contested]
    _say_all(kept, "cells with two answers")
    for suite, count in found.unversioned.items():
        _say(f"{count} rows of {suite} are older than versions of suites: theirs is not known")
    _say(f"report: {shlex.join(['python', '-m', 'reports', str(out)])}")


@click.command(no_args_is_help=True)
@click.argument("archive", metavar="ARCHIVE", type=PATH)
@click.pass_context
def verify(ctx: click.Context, archive: Path) -> None:
    """Compute every metric of an archive anew, from its maps, and say what differs.

    Models are loaded by name and compared by hash. Exit status 1 if anything differs.
    """
    told = _Told()

    def scores(
        store: Store, rows: list[ResultRow]
    ) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
        return scoring.scored_here(store, rows, told)

    found = recomputing.verify(archive, scores)
    _say_all(found.faults, "differences")
    count = len(found.faults)
    _say(
        f"{archive}: {found.rows} rows, {found.maps} maps, {found.values} values computed anew: "
        f"{count or 'no'} difference{'s' * (count != 1)}"
    )
    if count:
        ctx.exit(1)


@click.command(no_args_is_help=True, options_metavar="[OPTIONS] --method NAME --out DIR")
@click.argument("folder", metavar="MAPS", type=PATH)
@click.option("--method", required=True, metavar="NAME", help="What the method is called: a text.")
@click.option("--suite", default="paper", show_default=True, help="The suite of its cases.")
@click.option("--out", required=True, metavar="DIR", type=PATH, help="The results folder.")
def submit(folder: Path, method: str, suite: str, out: Path) -> None:
    """Score maps that any tool has made.

    MAPS holds OBJ files with UVs, named by case. The faces are those of the model, in its order. If
    one file is not so, all are refused.
    """
    chosen = suites.suite(suite)
    submission = submissions.read(folder, method, chosen)
    store = Store(out)
    with store.writing():
        here = environment.environment() | versions.noted(chosen.name)
        run = store.add_run(here | {"submitted": submission.method})
        known = {row.id for row in store.rows()}
        for row in submissions.rows(store, submission, chosen, run):
            if row.id not in known:
                store.append(row)
        values, reasons = scoring.scored_here(store, measuring.unmeasured(store), _Told())
        measuring.metrics(store, values)
    _say(f"{out}: {len(submission.maps)} maps of {submission.method}")
    if submission.missing:
        count = f"{len(submission.missing)} of {len(chosen.cases)} cases"
        _say(f"missing: {count}: {', '.join(submission.missing)}")
    if submission.clouds:
        _say(f"{len(submission.clouds)} cases of {chosen.name} are clouds, which have no faces")
    for row_id, reason in reasons.items():
        _say(f"{row_id}: no metrics: {reason}")
    _say(f"report: {shlex.join(['python', '-m', 'reports', str(out)])}")
