"""`--memory`: what every command that reads files takes."""

from __future__ import annotations

import click

from parapoint.files.decoding import allow
from parapoint.parameters import MOST_MEMORY, check_number


def _allow(_: click.Context, __: click.Parameter, gigabytes: float | None) -> None:
    if gigabytes is not None:
        check_number("--memory", gigabytes, most=MOST_MEMORY, above=True)
        allow(gigabytes * 1e9)


memory_option = click.option(
    "--memory",
    type=float,
    metavar="GB",
    expose_value=False,
    callback=_allow,
    help="What a file may decode to, where it is packed.",
)
"""Lifts the bound on what files decode to."""
