"""Fills the page of commands with the help that each command prints (a hook of mkdocs)."""

from typing import Any

import click

from benchmarks.__main__ import main as benchmarks
from parapoint.cli import parapoint
from reports.__main__ import main as reports

PLACE = "<!-- the help of every command -->"
PROGRAMS: dict[str, click.Command] = {
    "parapoint": parapoint,
    "python -m benchmarks": benchmarks,
    "python -m reports": reports,
}


def helps(name: str, command: click.Command) -> list[str]:
    """The help of a command and of its subcommands, as Markdown."""
    settings = {**command.context_settings, "max_content_width": 88}
    with click.Context(command, info_name=name, **settings) as context:
        found = [f"## {name}\n\n```text\n{command.get_help(context)}\n```\n"]
        if isinstance(command, click.Group):
            for word in command.list_commands(context):
                inner = command.resolve_command(context, [word])[1]
                if inner is not None:
                    found += helps(f"{name} {word}", inner)
    return found


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The page with the helps in their place."""
    if PLACE not in markdown:
        return markdown
    texts = [text for name, command in PROGRAMS.items() for text in helps(name, command)]
    return markdown.replace(PLACE, "\n".join(texts))
