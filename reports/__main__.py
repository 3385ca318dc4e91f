"""`python -m reports DIR`: tables, figures and a page from a results folder, in DIR/report."""

from __future__ import annotations

from pathlib import Path

import click

from benchmarks.environment import cores
from parapoint import console


@click.command(help="Write tables, figures and index.html for the results in DIR to DIR/report.")
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--exports", is_flag=True, help="Every map as a textured OBJ and GLB, too.")
def main(folder: Path, exports: bool) -> None:
    """Write the report, and say where it is."""
    from reports.report import write

    print(write(folder, jobs=cores(), textured=exports))


if __name__ == "__main__":
    console.run(main)
