"""What `python -m reports DIR --against OTHER` writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from parapoint.errors import InputError
from parapoint.files.targets import write_text
from reports.history.comparison import Comparison
from reports.history.tables import alone, by_metric, ended, moved, summary
from reports.pictures.names import slug
from reports.tables import formats


def write(folder: Path, others: Sequence[Path]) -> list[tuple[Path, str]]:
    """Compare `folder` with each of `others`, which came before; each page written, and its lead.

    To `folder`/report/history/OTHER: index.html, and every table in all formats.

    Raises:
        InputError: a folder is missing, holds no results, or is of a newer version; two are one.
    """
    written = []
    for other in others:
        if other.resolve() == folder.resolve():
            raise InputError(f"{other}: a folder is not compared with itself; name another")
        found = Comparison(other, folder)
        tables = [by_metric(found), summary(found), moved(found), ended(found), alone(found)]
        made = [table for table in tables if table is not None]
        into = folder / "report" / "history" / slug(other.resolve().name)
        formats.write(made, into)
        lead = said(found)
        page = formats.html(f"{folder} against {other}", made, lead)
        write_text(into / "index.html", page)
        written.append((into / "index.html", lead))
    return written


def said(found: Comparison) -> str:
    """The comparison in one line."""
    if not found.shared:
        return "The two folders have no cell in common."
    moves = {move.key for move in found.moves}
    worse = {move.key for move in found.moves if move.verdict == "worse"}
    ends = sum(old.status != new.status for old, new in map(found.group, found.shared))
    times = f"{len(found.times)} times moved" if found.same_hardware else "times are not comparable"
    return (
        f"Of {len(found.shared)} cells in both, {len(moves)} moved beyond noise, {len(worse)} of "
        f"them for the worse in some metric; another status in {ends}; {times}."
    )
