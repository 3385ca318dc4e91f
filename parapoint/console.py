"""How every command of the project ends: one clear line and exit status 2 on wrong use or input."""

from __future__ import annotations

import sys
from typing import Never

import click

from parapoint.errors import InputError


def run(command: click.Command, arguments: list[str] | None = None) -> Never:
    """Run a click command and exit: 0 or the command's own status, 2 with one line on bad input."""
    try:
        status = command.main(arguments, standalone_mode=False)
    except click.ClickException as error:
        fail(error.format_message())
    except (InputError, OSError) as error:
        fail(str(error))
    except (KeyboardInterrupt, click.Abort):
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(status if isinstance(status, int) else 0)


def fail(message: str) -> Never:
    """Print `message` as one line to standard error and exit with status 2."""
    print("error: " + " ".join(message.split()), file=sys.stderr)
    sys.exit(2)
