"""The version of a suite that rows belong to: rows of two versions are never mixed in silence."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from benchmarks.cases.suites import SUITES
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow

UNKNOWN = "unknown"
"""Stands for the version of rows that are older than versions."""


def noted(suite: str) -> dict[str, object]:
    """What the environment of a run says of its suite: name, version and hash.

    A suite of the user's own has no version.
    """
    known = SUITES.get(suite)
    if known is None:
        return {"suite": suite}
    return {"suite": suite, "suite_version": known.version, "suite_hash": known.digest}


def version(row: ResultRow, runs: list[Any]) -> str:
    """The version of the suite that a row belongs to, such as "1 (0123456789abcdef)".

    Args:
        row: the row.
        runs: the environments of the runs of its folder.
    """
    if row.suite not in SUITES:
        return ""
    entry = runs[row.run] if 0 <= row.run < len(runs) else None
    found = entry.get("suite_hash") if isinstance(entry, dict) else None
    if not isinstance(found, str) or not isinstance(entry, dict):
        return UNKNOWN
    return f"{entry.get('suite_version')} ({found})"


def versions(store: Store, rows: Iterable[ResultRow]) -> dict[str, dict[str, int]]:
    """By suite, how many of the rows of a folder belong to which version."""
    runs = store.environment()["runs"]
    found: dict[str, dict[str, int]] = {}
    for row in rows:
        if name := version(row, runs):
            counts = found.setdefault(row.suite, {})
            counts[name] = counts.get(name, 0) + 1
    return found


def said(counts: dict[str, int]) -> str:
    """The versions of a suite in words, such as "12 of version 1 (...), 3 of version unknown"."""
    return ", ".join(f"{count} of version {name}" for name, count in counts.items())
