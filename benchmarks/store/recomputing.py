"""Verifying a published archive: every metric computed anew from its maps, on models by hash."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.store import publishing, verifying
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError

RELATIVE, ABSOLUTE = 1e-6, 1e-9
"""Two values of a metric differ if they do so by more than both. Another processor sums in another
order, which changes less; another map changes far more."""
Scores = Callable[[Store, list[ResultRow]], tuple[dict[str, dict[str, float]], dict[str, str]]]
"""Computes the metrics of rows: by row id the values, and why there are none."""


@dataclass
class Verified:
    """What an archive came to.

    Attributes:
        rows: how many rows it has.
        maps: how many maps were measured anew.
        values: how many metrics were compared.
        faults: what differs or could not be checked, one line each.
    """

    rows: int = 0
    maps: int = 0
    values: int = 0
    faults: list[str] = field(default_factory=list)


def verify(archive: Path, scores: Scores) -> Verified:
    """Compute every metric of an archive anew, and compare it with what the archive says.

    Args:
        archive: what `publishing.publish` wrote.
        scores: computes the metrics.

    Raises:
        InputError: it is no archive of ours, or has been changed since it was published.
    """
    if archive.is_dir():
        raise InputError(f"{archive} is a folder: `python -m benchmarks check {archive}` checks it")
    found = Verified()
    with publishing.opened(archive) as store:
        rows = store.rows()
        said = publishing.published_metrics(store)
        missing = publishing.supply_surfaces(store, store, rows)
        found.rows = len(rows)
        found.faults += [f"{case}: cannot be checked: {why}" for case, why in missing.items()]
        known = [row for row in rows if row.case not in missing]
        found.faults += verifying.file_faults(store, known)
        maps = [row for row in known if row.status == "ok"]
        values, reasons = scores(store, maps)
        found.maps = len(maps)
        for row in maps:
            named = f"{row.case}, {row.method}, seed {row.seed} ({row.id})"
            if row.id in reasons:
                found.faults.append(f"{named}: cannot be measured: {reasons[row.id]}")
                continue
            told = said.get(row.id, {})
            found.values += len(told)
            found.faults += [f"{named}: {what}" for what in _differences(told, values[row.id])]
    return found


def _differences(said: dict[str, float], computed: dict[str, float]) -> Iterator[str]:
    """The metrics in which what an archive says differs from what its map gives."""
    for name in dict.fromkeys([*said, *computed]):
        old, new = said.get(name, math.nan), computed.get(name, math.nan)
        both_missing = math.isnan(old) and math.isnan(new)
        if not (both_missing or math.isclose(old, new, rel_tol=RELATIVE, abs_tol=ABSOLUTE)):
            yield f"{name} is {old:.9g} in the archive, {new:.9g} from the map"
