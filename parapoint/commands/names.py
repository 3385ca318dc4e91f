"""The names of files and folders that commands are given."""

from __future__ import annotations

import os
from typing import Any

import click

from parapoint.errors import InputError


class _Name(click.Path):
    """A name that says something: an empty one would mean the folder in which a command runs."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        """The name.

        Raises:
            InputError: it is empty.
        """
        if not value and param is not None:
            given = param.opts[0] if isinstance(param, click.Option) else param.metavar
            raise InputError(f"{given} is an empty name; name a file or a folder")
        return super().convert(value, param, ctx)


NAME = _Name()
