"""The lines under a table: where its numbers come from, what was done, what failed."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.store import versions
from reports.contents import Contents
from reports.ranking import COLLAPSED_FLAG


def environment_note(contents: Contents) -> str:
    """Where the numbers come from: machine, commit, versions, seeds."""
    runs = contents.runs
    used = {row.run for row in contents.rows}
    said = []
    for number, run in enumerate(runs):
        if number not in used or not isinstance(run, Mapping):
            continue
        commit = str(run.get("commit") or "unknown")[:12]
        changed = " with local changes" if run.get("dirty") else ""
        said.append(
            f"commit {commit}{changed}, {run.get('cpu') or 'unknown processor'}, "
            f"{run.get('cores', '?')} cores, Python {run.get('python', '?')}"
        )
    seeds = sorted({row.seed for row in contents.rows})
    places = "; ".join(dict.fromkeys(said)) or "environment not recorded"
    return f"Run on: {places}. Seeds: {', '.join(map(str, seeds))}."


BUSY = 1.25
"""Load (processes that ran or waited, over the processors) above which times are told as unsure.

On a machine that does nothing else a cell with all processors to itself comes to 1.
"""


def load_notes(contents: Contents) -> list[str]:
    """Which times were taken while the machine had more to do than it could."""
    timed = [row for row in contents.rows if row.seconds is not None]
    busy = [row for row in timed if row.load is not None and row.load > BUSY]
    notes = []
    if busy:
        most = max(row.load or 0 for row in busy)
        notes.append(
            f"The machine was busy during {len(busy)} of {len(timed)} cells (up to {most:.1f} "
            "processes for each processor): their wall times are too long; processor times are "
            "less touched."
        )
    return notes


def version_notes(contents: Contents) -> list[str]:
    """Whether the rows belong to several versions of the suite, and how many to each."""
    counts = versions.versions(contents.store, contents.rows).get(contents.suite, {})
    if len(counts) < 2:
        return []
    return [f"Several versions of the suite are mixed here: {versions.said(counts)}."]


def grade_notes(contents: Contents) -> list[str]:
    """Which maps are broken and thus not ranked, and which are collapsed."""
    notes = []
    for grade, meaning in (
        ("broken", "broken, so not ranked"),
        ("collapsed", f"collapsed, so ranked by angles alone ({COLLAPSED_FLAG})"),
    ):
        found = [
            f"{label} on {case}"
            for (case, label), record in contents.records.items()
            if record["grade"] == grade
        ]
        if found:
            notes.append(f"{meaning.capitalize()}: {', '.join(found)}.")
    return notes


def method_notes(contents: Contents) -> list[str]:
    """What was done to a surface before a method saw it, and which methods are no rivals."""
    notes = []
    if contents.atlases:
        notes.append(
            f"Not ranked: {', '.join(sorted(contents.atlases))}, which cut the surface into many "
            "charts; the others give one map of the whole."
        )
    if contents.partial:
        notes.append(
            f"Not ranked: {', '.join(sorted(contents.partial))}, which map a part of the surface "
            "alone."
        )
    steps: dict[str, set[str]] = {}
    for row in contents.rows:
        if row.preprocessing:
            steps.setdefault(row.preprocessing, set()).add(row.case)
    for step, cases in steps.items():
        notes.append(
            f"{step.capitalize()}, the same for every method that needs it: "
            f"{', '.join(sorted(cases))}."
        )
    return notes


def failure_notes(contents: Contents) -> list[str]:
    """A line for each way in which cells gave no map."""
    reasons: dict[tuple[str, str, str], list[str]] = {}
    for row in contents.rows:
        if row.status != "ok":
            key = (contents.labels[row.id].short, row.status.replace("_", " "), row.reason)
            reasons.setdefault(key, []).append(row.case)
    return [
        f"{method} {status} on {', '.join(dict.fromkeys(cases))}: {reason or 'no reason given'}."
        for (method, status, reason), cases in reasons.items()
    ]


def legend(contents: Contents) -> str:
    """What the short names of the methods stand for."""
    told = [f"{label.short}: {label.detail}" for label in contents.methods if label.detail]
    return f"Methods. {'; '.join(told)}."
