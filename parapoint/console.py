"""How every command of the project starts and ends.

A group imports a command when it runs, so that its help comes at once. Wrong use and bad input end
with one clear line and exit status 2.
"""

from __future__ import annotations

import hashlib
import importlib
import logging
import sys
from typing import TYPE_CHECKING, Any, Never

import click

from parapoint.errors import InputError

if TYPE_CHECKING:
    from rich.console import Console

LONGEST_MESSAGE = 2000
"""Characters of a message that are printed."""
LONGEST_NAME = 200
"""Characters of a name that are shown."""


class LazyGroup(click.Group):
    """A group of commands, each of which is imported when it is asked for by name.

    Until then a placeholder stands for it in the group's help.
    """

    def __init__(self, *arguments: Any, **settings: Any) -> None:
        """A group without commands; the arguments are those of `click.Group`."""
        super().__init__(*arguments, **settings)
        self._places: dict[str, str] = {}

    def add_lazily(self, name: str, place: str, summary: str) -> None:
        """Add the command at `place`, such as "package.module:command".

        Args:
            name: what it is called by.
            place: where it is.
            summary: the first sentence of its help.
        """
        self._places[name] = place
        self.add_command(click.Command(name, short_help=summary))

    def list_commands(self, ctx: click.Context) -> list[str]:  # noqa: ARG002 (click's signature)
        """The names of the commands, in the order in which they were added."""
        return list(self.commands)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments begin with, imported, and the other arguments."""
        name, command, rest = super().resolve_command(ctx, args)
        if name in self._places:
            module, _, attribute = self._places[name].partition(":")
            command = getattr(importlib.import_module(module), attribute)
        return name, command, rest


def terminal(*, stderr: bool = False) -> Console:
    """The console of rich on standard output or error: drawn on if it is a terminal, plain if not.

    Rich alone would draw bars into a notebook's pipe, as Jupyter sets FORCE_COLOR.
    """
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    return Console(stderr=stderr, force_terminal=stream.isatty())


def printable(text: str, longest: int = LONGEST_NAME) -> str:
    """Text from elsewhere as one line that nothing reads as more than text.

    A terminal obeys control characters, a page may be turned by those of writing from right to
    left, and halves of surrogate pairs cannot be encoded: each is written as its Python escape.

    Args:
        text: what is to be shown.
        longest: characters after which it is cut; a hash then tells it from others.
    """
    shown = "".join(
        letter if letter.isprintable() else letter.encode("unicode_escape").decode()
        for letter in text
    )
    if len(shown) <= longest:
        return shown
    return f"{shown[:longest]}… ({hashlib.sha256(shown.encode()).hexdigest()[:6]})"


class PlainFormatter(logging.Formatter):
    """The messages of a log alone, each as one line that a terminal reads as text."""

    def format(self, record: logging.LogRecord) -> str:
        """The line of a record."""
        return printable(super().format(record), LONGEST_MESSAGE)


def run(command: click.Command, arguments: list[str] | None = None) -> Never:
    """Run a click command and exit.

    The status is 0 or the command's own, and 2 with one line on bad input. A command that needs
    arguments and gets none prints its whole help, with status 2, too.
    """
    try:
        status = command.main(arguments, standalone_mode=False)
    except click.exceptions.NoArgsIsHelpError as error:
        print(error.format_message(), file=sys.stderr)
        sys.exit(2)
    except click.UsageError as error:
        more = "" if error.ctx is None else f" (see: {error.ctx.command_path} --help)"
        fail(error.format_message().removesuffix(".") + more)
    except click.ClickException as error:
        fail(error.format_message())
    except InputError as error:
        fail(str(error))
    except ModuleNotFoundError as error:
        fail(f"{error.name} is not installed; in a checkout, pip install -e '.[bench]' brings it")
    except OSError as error:
        fail(_in_words(error))
    except (KeyboardInterrupt, click.Abort):
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    sys.exit(status if isinstance(status, int) else 0)


def _in_words(error: OSError) -> str:
    """What the system refused, and the file where it is known."""
    if error.strerror is None:
        return str(error)
    said = error.strerror[:1].lower() + error.strerror[1:]
    return f"{error.filename}: {said}" if error.filename else said


def fail(message: str) -> Never:
    """Print `message` as one line to standard error and exit with status 2."""
    print("error: " + printable(" ".join(message.split()), LONGEST_MESSAGE), file=sys.stderr)
    sys.exit(2)
