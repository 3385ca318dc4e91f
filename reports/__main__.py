"""`python -m reports DIR`: a report; `python -m reports site | markdown`: the reference ones."""

from __future__ import annotations

from pathlib import Path

import click

from benchmarks.running.environment import cores
from parapoint import __version__, console
from parapoint.commands.memory import memory_option

PATH = click.Path(path_type=Path)


class _WithReport(click.Group):
    """A group whose command `report` needs no name: `python -m reports DIR`."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        own = {*self.commands, *ctx.help_option_names, "--version"}
        if args and args[0] not in own:
            args.insert(0, "report")
        return super().parse_args(ctx, args)


@click.group(cls=_WithReport, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="parapoint reports")
def main() -> None:
    """Tables, figures and pages from results folders: `python -m reports DIR` writes DIR/report."""


@main.command(
    help=(
        "Write tables, figures and a page for DIR. They go to DIR/report, with index.html. With "
        "--against, write what moved since OTHER to DIR/report/history instead."
    ),
)
@click.argument("folder", metavar="DIR", type=PATH)
@click.option("--exports", is_flag=True, help="Every map as a textured OBJ and GLB, too.")
@click.option(
    "--against",
    metavar="OTHER",
    multiple=True,
    type=PATH,
    help="An earlier results folder, or another machine's; may be given several times.",
)
@memory_option
def report(folder: Path, exports: bool, against: tuple[Path, ...]) -> None:
    """Write the report, or the comparisons, and say where they are."""
    if against:
        from reports.history import pages

        for page, said in pages.write(folder, against):
            print(f"{page}: {said}")
        return
    from reports.progress import Shown
    from reports.report import write

    print(write(folder, jobs=cores(), textured=exports, progress=Shown()))


@main.command()
@click.argument("sources", metavar="DIR...", nargs=-1, required=True, type=PATH)
@click.option("--out", default="site", show_default=True, type=PATH, help="Folder of the site.")
def site(sources: tuple[Path, ...], out: Path) -> None:
    """Write a static site of several results.

    DIR is a results folder or an archive; give the oldest first. Of a cell in several, the newest
    is shown; the history says what moved.
    """
    from reports.progress import Shown
    from reports.site import building

    built = building.build(sources, out, jobs=cores(), progress=Shown())
    print(f"{built.index}: {built.cells} cells, {built.size / 1e6:.1f} MB")
    building.check_size(built)


@main.command()
@click.argument("sources", metavar="DIR...", nargs=-1, required=True, type=PATH)
@click.option("--out", default="docs/RESULTS.md", show_default=True, type=PATH)
def markdown(sources: tuple[Path, ...], out: Path) -> None:
    """Write results as one page of Markdown, a section for each suite.

    A section names the commit, the machine and its load. On a page that is there already the
    sections of other suites stay.
    """
    from reports.site.markdown import write

    print(write(sources, out))


if __name__ == "__main__":
    console.run(main)
