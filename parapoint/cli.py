"""The command `parapoint`: unwrap | fit | map | bake."""

from __future__ import annotations

import logging
import os
from typing import Never

import click

from parapoint import __version__, console


@click.group(cls=console.LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="parapoint")
def parapoint() -> None:
    """UV maps of point clouds and meshes."""
    # The handler of last resort asks for sys.stderr at each line, which a progress bar replaces.
    assert logging.lastResort is not None
    logging.lastResort.setFormatter(console.PlainFormatter())
    logging.basicConfig(handlers=[logging.lastResort])


for name, place, summary in (
    ("unwrap", "unwrap:unwrap", "Lay a mesh or a point cloud out in the unit square."),
    ("fit", "fit:fit", "Find the map of a mesh or a point cloud and save it."),
    ("map", "map:map_", "Apply a saved map to other points of its surface."),
    ("bake", "bake:bake", "Paint what the points of a cloud know into a texture."),
):
    parapoint.add_lazily(name, f"parapoint.commands.{place}", summary)


def main() -> Never:
    """The `parapoint` command."""
    # Threads that spin while they wait keep the one that they wait for off a busy machine's core.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    console.run(parapoint)
