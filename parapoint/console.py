"""How every command of the project ends: one clear line and exit status 2 on wrong use or input."""

from __future__ import annotations

import hashlib
import sys
from typing import Never

import click

from parapoint.errors import InputError

LONGEST_MESSAGE = 2000
"""Characters of a message that are printed."""
LONGEST_NAME = 200
"""Characters of a name that are shown."""


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


def run(command: click.Command, arguments: list[str] | None = None) -> Never:
    """Run a click command and exit: 0 or the command's own status, 2 with one line on bad input."""
    try:
        status = command.main(arguments, standalone_mode=False)
    except click.ClickException as error:
        fail(error.format_message())
    except InputError as error:
        fail(str(error))
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
