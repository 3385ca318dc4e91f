"""What to cite for the methods of a report: one file of BibTeX."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from benchmarks.commands.listing import credit
from reports.contents import Contents

NAME = "methods.bib"
"""Name of the file, beside the index."""


def write(folder: Path, suites: Iterable[Contents]) -> None:
    """Write the entries of all methods of some suites, each once, to `folder`/methods.bib."""
    methods = dict.fromkeys(label.method for suite in suites for label in suite.methods)
    entries = dict.fromkeys(entry for method in methods for entry in credit(method)[1])
    (folder / NAME).write_text("\n\n".join(entries) + "\n" * bool(entries), encoding="utf-8")
