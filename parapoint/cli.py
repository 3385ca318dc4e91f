"""The command `parapoint`: fit | map | unwrap | bake."""

from __future__ import annotations

import logging
from typing import Never

import click

from parapoint import console
from parapoint.commands.bake import bake
from parapoint.commands.fit import fit
from parapoint.commands.map import map_
from parapoint.commands.unwrap import unwrap


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
def parapoint() -> None:
    """UV maps of point clouds and meshes."""
    logging.basicConfig(format="%(message)s")


for command in (fit, map_, unwrap, bake):
    parapoint.add_command(command)


def main() -> Never:
    """The `parapoint` command."""
    console.run(parapoint)
