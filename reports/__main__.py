"""`python -m reports DIR`: tables, figures and a page from a results folder, in DIR/report."""

from __future__ import annotations

from pathlib import Path

import click

from benchmarks.running.environment import cores
from parapoint import __version__, console
from parapoint.commands.memory import memory_option


@click.command(
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=(
        "Write tables, figures and index.html for the results in DIR to DIR/report. With "
        "--against, write what moved since OTHER to DIR/report/history instead."
    ),
)
@click.version_option(__version__, prog_name="parapoint reports")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--exports", is_flag=True, help="Every map as a textured OBJ and GLB, too.")
@click.option(
    "--against",
    metavar="OTHER",
    multiple=True,
    type=click.Path(path_type=Path),
    help="An earlier results folder, or another machine's; may be given several times.",
)
@memory_option
def main(folder: Path, exports: bool, against: tuple[Path, ...]) -> None:
    """Write the report, or the comparisons, and say where they are."""
    if against:
        from reports.history import pages

        for page, said in pages.write(folder, against):
            print(f"{page}: {said}")
        return
    from reports.progress import Shown
    from reports.report import write

    print(write(folder, jobs=cores(), textured=exports, progress=Shown()))


if __name__ == "__main__":
    console.run(main)
