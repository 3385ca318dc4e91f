"""`python -m benchmarks`: run, list, check, score, publish and more; `--help` names all."""

from __future__ import annotations

import logging
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from parapoint import __version__, console
from parapoint.errors import InputError

if TYPE_CHECKING:
    from benchmarks.cases.suites import Suite
    from benchmarks.running.runner import Summary

SUITE = "paper"
"""The suite that `run` runs if none is named."""


@click.group(cls=console.LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="parapoint benchmarks")
def main() -> None:
    """Compare parameterization methods on real models, and score UV maps."""
    logging.basicConfig(format="%(message)s")


def split(text: str) -> list[str]:
    """The parts of a list that commas separate, except for commas inside brackets or quotes.

    Raises:
        InputError: a bracket or a quote is not closed, or a part is empty.
    """
    parts = [""]
    quote, depth = "", 0
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        else:
            depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and not quote and not depth:
            parts.append("")
        else:
            parts[-1] += letter
    parts = [part.strip() for part in parts]
    if quote or depth or not all(parts):
        raise InputError(f"{text!r} is no list such as a,b or a,b(x=1,y=2)")
    return parts


def _list(_: click.Context, __: click.Parameter, text: str | None) -> list[str] | None:
    """The value of an option that is a list of texts."""
    return None if text is None else split(text)


def _cases(_: click.Context, __: click.Parameter, text: str | None) -> list[str] | None:
    """The value of --cases: names that commas separate. A file's own name may hold commas too.

    Raises:
        InputError: a name is empty.
    """
    if text is None:
        return None
    parts, found = text.split(","), []
    while parts:
        whole = [n for n in range(len(parts), 1, -1) if Path(",".join(parts[:n]).strip()).is_file()]
        count = whole[0] if whole else 1
        found.append(",".join(parts[:count]).strip())
        del parts[:count]
    if not all(found):
        raise InputError(f"{text!r} is no list such as cow,hand or cow,scans/my.ply")
    return found


def _seeds(_: click.Context, __: click.Parameter, text: str | None) -> list[int] | None:
    """The value of an option that is a list of seeds."""
    if text is None:
        return None
    if not all(part.isascii() and part.isdigit() and len(part) < 30 for part in split(text)):
        raise InputError(f"seeds are whole numbers from 0, such as 0,1,2; not {text[:100]!r}")
    return [int(part) for part in split(text)]


@main.command()
@click.argument("suite", required=False)
@click.option("--methods", callback=_list, help="Such as slim,tutte or 'slim(iterations=1),lscm'.")
@click.option("--cases", callback=_cases, help="Names of models, or paths of files of your own.")
@click.option("--seeds", callback=_seeds, help="Such as 0,1,2.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Cells at once.")
@click.option(
    "--executor",
    default="local",
    show_default=True,
    metavar="local|dask[+tls]://HOST:PORT|slurm",
    help="Where cells run: here, or on the workers of a cluster (docs/SCALE.md).",
)
@click.option(
    "--timeout",
    type=float,
    default=1800,
    show_default=True,
    help="Seconds a cell may take.",
)
@click.option(
    "--memory",
    type=float,
    help="GB that a cell may hold, and that a packed file may decode to.  [default: 0.8 of the "
    "machine's memory, shared out among the jobs; 0.07 for a file]",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of the results.  [default: results/SUITE, or results/custom for --cases alone]",
)
@click.option(
    "--plugin", "plugins", multiple=True, metavar="FILE.py:Class", help="A method to add."
)
@click.option("--strict", is_flag=True, help="Exit with 1 if a cell did not end well.")
@click.pass_context
def run(
    ctx: click.Context,
    /,
    suite: str | None,
    cases: list[str] | None,
    out: Path | None,
    *,
    strict: bool,
    **options: Any,
) -> None:
    """Run SUITE (default: paper), or what its results lack.

    A second run goes on where the first one ended. Results of all runs stay in the folder.
    """
    from benchmarks.cases import suites
    from benchmarks.commands.display import BAD
    from parapoint.files.decoding import allow

    if options["memory"] is not None:
        allow(options["memory"] * 1e9)

    if suite is None and cases is not None:
        chosen = suites.Suite(
            "custom", "cases of the command line", tuple(cases), suites.suite(SUITE).methods, (0,)
        )
    else:
        chosen = suites.suite(suite or SUITE)
    out = Path("results", chosen.name) if out is None else out
    summary = _shown_run(chosen, out, cases=cases, **options)
    rows = summary.rows
    if cases is None and chosen.cases and len(summary.missing) == len(summary.suite.cases):
        print(
            f"\nNo model of {chosen.name} could be had (each is named above, with how to get it)."
            "\nThe built-in surfaces run in their place.\n"
        )
        rows = [*rows, *_shown_run(suites.suite("builtin"), out, **options).rows]
    print(f"results: {out}   report: {shlex.join(['python', '-m', 'reports', str(out)])}")
    if strict and any(row.status in BAD for row in rows):
        ctx.exit(1)


def _shown_run(suite: Suite, out: Path, **options: Any) -> Summary:
    """Run a suite, and show the user how it goes."""
    from benchmarks.commands.display import Display, print_summary
    from benchmarks.running import runner
    from benchmarks.store import versions
    from benchmarks.store.results import Store

    with Display() as progress:
        summary = runner.run(suite, out, progress=progress, **options)
    print_summary(summary)
    store = Store(out)
    for name, counts in versions.versions(store, store.rows()).items():
        if len(counts) > 1:
            print(f"{out} holds {name} in several versions: {versions.said(counts)}")
    return summary


@main.command("list", no_args_is_help=True)
@click.argument("what", type=click.Choice(["suites", "cases", "methods", "metrics"]))
def list_(what: str) -> None:
    """List suites, cases, methods or metrics.

    A terminal shows them as a table, and a pipe gets tab-separated values.
    """
    from benchmarks.commands.listing import LISTS
    from benchmarks.commands.tables import entries, print_table

    print_table(LISTS[what](), entries)


@main.command(no_args_is_help=True)
@click.argument("folder", type=click.Path(path_type=Path), metavar="DIR")
@click.pass_context
def check(ctx: click.Context, folder: Path) -> None:
    """Verify the rows of a results folder.

    Every row is held against its files, and a sample of the metrics is computed anew.
    """
    from benchmarks.store import verifying
    from benchmarks.store.results import Store

    if not (folder / "runs.jsonl").is_file():
        raise InputError(f"{folder} is no results folder: it has no runs.jsonl")
    store = Store(folder)
    faults = 0
    for fault in verifying.faults(store):
        faults += 1
        print(console.printable(fault, console.LONGEST_MESSAGE))
    rows = store.rows()
    maps = sum(row.status == "ok" for row in rows)
    print(f"{len(rows)} cells, {maps} maps: {faults or 'no'} fault{'s' * (faults != 1)}")
    if faults:
        ctx.exit(1)


for name, place, summary in (
    ("score", "score:score", "Grade and metrics of any UV map."),
    ("publish", "travelling:publish", "Write a results folder into one sealed archive."),
    ("merge", "travelling:merge", "Join results folders and archives into a new folder."),
    (
        "verify",
        "travelling:verify",
        "Compute every metric of an archive anew, from its maps, and say what differs.",
    ),
    ("submit", "travelling:submit", "Score maps that any tool has made."),
):
    main.add_lazily(name, f"benchmarks.commands.{place}", summary)


@main.command()
@click.option(
    "--figure",
    type=click.Path(path_type=Path),
    metavar="OUT.png",
    help="Draw how the metrics' time and memory grow with the faces.",
)
@click.option(
    "--race",
    metavar="CASE",
    help="Instead: time to quality on a model, against a straightforward implementation.",
)
@click.option(
    "--seconds",
    type=float,
    default=180.0,
    show_default=True,
    help="Processor time of each way in the race.",
)
def speed(figure: Path | None, race: str | None, seconds: float) -> None:
    """Measure how fast the heavy parts are.

    These are the metrics, what a run adds to its methods, and ParaPoint's training.
    """
    from benchmarks.commands.method_speed import overhead_table, overheads
    from benchmarks.commands.metric_speed import growth_figure, metric_costs, metric_table
    from benchmarks.commands.speed import training_table
    from benchmarks.commands.tables import print_table
    from parapoint.parameters import LONGEST_SECONDS, check_number

    check_number("--seconds", seconds, most=LONGEST_SECONDS, above=True)
    if race is not None:
        from benchmarks.checks.straightforward import race_table

        print_table(race_table(race, seconds))
        return
    if figure is not None and figure.suffix.lower() != ".png":
        raise InputError(f"{figure}: the figure is a PNG; give a name that ends in .png")
    costs = metric_costs()
    print_table(metric_table(costs))
    if figure is not None:
        growth_figure(costs, figure)
    print_table(overhead_table(overheads()))
    print_table(training_table())


if __name__ == "__main__":
    console.run(main)
