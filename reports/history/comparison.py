"""The cells that two results folders share, and which of their values moved beyond noise."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import stats

from benchmarks.checks.promises import repeats
from benchmarks.metrics.table import METRICS
from benchmarks.store.rows import ResultRow
from reports.contents import Contents, contents
from reports.ranking import TIMES
from reports.tables.suites import SUMMARY_METRICS

Floats = npt.NDArray[np.float64]

WATCHED = tuple(name for name in SUMMARY_METRICS if name not in TIMES)
"""The metrics that are compared, over all faces and without those that span a seam."""

ROUNDING = 1e-6
"""Relative change that other hardware may make where chance has no part."""

ONE_SEED = 0.05
"""Relative change taken for noise where chance has a part and a cell has one seed."""

ONE_TIME, LEAST_SECONDS = 0.25, 0.1
"""Change of a single time taken for noise: relative, and in seconds."""

HARDWARE = ("cpu", "cores", "gpu")
"""Entries of an environment without which times are not comparable."""

Key = tuple[str, str, str, str]
"""Suite, case, method and parameters as JSON: a cell but for its seed."""


@dataclass(frozen=True)
class Group:
    """The seeds of one cell in one folder.

    Attributes:
        short: the method's name in tables.
        rows: by seed.
        values: (n,) values over the seeds that gave a map, by metric; and "seconds".
    """

    short: str
    rows: Mapping[int, ResultRow]
    values: Mapping[str, Floats]

    @property
    def seeds(self) -> set[int]:
        """The seeds that gave a map."""
        return {seed for seed, row in self.rows.items() if row.status == "ok"}

    @property
    def maps(self) -> set[str]:
        """Hashes of the maps."""
        return {row.uv_sha256 for row in self.rows.values() if row.status == "ok"}

    @property
    def status(self) -> str:
        """How the seeds ended, "ok" where all did."""
        found = sorted({row.status.replace("_", " ") for row in self.rows.values()})
        return " / ".join(found)

    @property
    def reason(self) -> str:
        """Why a seed gave no map; "" where all gave one."""
        return next((row.reason for row in self.rows.values() if row.status != "ok"), "")


def groups(suites: Sequence[Contents]) -> dict[Key, Group]:
    """The cells of a folder, seeds together."""
    found: dict[Key, dict[int, ResultRow]] = {}
    shorts: dict[Key, str] = {}
    measured: dict[str, dict[str, Any]] = {}
    for suite in suites:
        for record in suite.measured.to_dict("records"):
            measured[record["id"]] = {str(name): value for name, value in record.items()}
        for row in suite.rows:
            params = json.dumps({n: v for n, v in sorted(row.params.items()) if n != "device"})
            key = (row.suite, row.case, row.method, params)
            found.setdefault(key, {})[row.seed] = row
            shorts[key] = suite.labels[row.id].short
    return {
        key: Group(
            shorts[key],
            rows,
            {
                name: np.array(
                    [measured[row.id][name] for row in rows.values() if row.status == "ok"]
                )
                for name in (*WATCHED, "seconds")
            },
        )
        for key, rows in found.items()
    }


@dataclass(frozen=True)
class Move:
    """A value that is not what it was.

    Attributes:
        key: the cell.
        name: metric, or "seconds".
        before, after: means over the seeds.
        noise: change up to which nothing is said.
        why: where the noise is from.
    """

    key: Key
    name: str
    before: float
    after: float
    noise: float
    why: str

    @property
    def verdict(self) -> str:
        """Which way it moved."""
        if self.name != "seconds" and METRICS[self.name].better not in {"lower", "higher"}:
            return "moved"
        higher_is_better = self.name != "seconds" and METRICS[self.name].better == "higher"
        return "better" if (self.after > self.before) == higher_is_better else "worse"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What two folders say of the same cells.

    Attributes:
        before, after: the folders.
        names: what the two are called; their paths unless something else is given.
    """

    before: Path
    after: Path
    names: tuple[str, str] = ("", "")

    @cached_property
    def _suites(self) -> tuple[list[Contents], list[Contents]]:
        return contents(self.before), contents(self.after)

    @cached_property
    def cells(self) -> tuple[dict[Key, Group], dict[Key, Group]]:
        """The cells before, and after."""
        return groups(self._suites[0]), groups(self._suites[1])

    @cached_property
    def shared(self) -> list[Key]:
        """The cells in both, in the order of `after`."""
        before, after = self.cells
        return [key for key in after if key in before]

    def only(self, side: int) -> list[Key]:
        """The cells in one alone: 0 for `before`, 1 for `after`."""
        other = self.cells[1 - side]
        return [key for key in self.cells[side] if key not in other]

    def group(self, key: Key) -> tuple[Group, Group]:
        """A shared cell before and after."""
        return self.cells[0][key], self.cells[1][key]

    @cached_property
    def machines(self) -> dict[str, tuple[str, str]]:
        """Entries of the environment that differ, before and after."""
        told = [_environment(suites) for suites in self._suites]
        return {
            name: (told[0].get(name, "unknown"), told[1].get(name, "unknown"))
            for name in dict.fromkeys([*told[0], *told[1]])
            if told[0].get(name) != told[1].get(name)
        }

    @property
    def same_hardware(self) -> bool:
        """Whether times may be compared: both ran on one, known, processor."""
        known = all(_environment(suites).get("cpu") for suites in self._suites)
        return known and not any(name in self.machines for name in HARDWARE)

    @cached_property
    def _repeats(self) -> dict[tuple[str, str], bool]:
        """Of methods with several seeds somewhere, whether these gave one map each time."""
        told: dict[tuple[str, str], bool] = {}
        for cells in self.cells:
            for (_, _, method, params), group in cells.items():
                if sum(row.status == "ok" for row in group.rows.values()) > 1:
                    same = len(group.maps) == 1
                    told[method, params] = told.get((method, params), True) and same
        return told

    @cached_property
    def _promised(self) -> dict[tuple[str, str], bool]:
        """Whether each method of the shared cells promises one map for one seed."""
        found = {key[2:] for key in self.shared}
        return {(method, params): repeats(method, json.loads(params)) for method, params in found}

    def is_deterministic(self, key: Key) -> bool:
        """Whether chance has no part in a change of a shared cell.

        Where a method has several seeds somewhere, their maps tell. Else its promise does, for the
        same seeds before and after.
        """
        told = self._repeats.get(key[2:])
        if told is not None:
            return told
        before, after = self.group(key)
        return before.seeds == after.seeds and self._promised[key[2:]]

    @cached_property
    def moves(self) -> list[Move]:
        """The metrics that moved beyond noise; without spanning faces where that is another."""
        found: dict[tuple[Key, float, float], Move] = {}
        for key in self.shared:
            for name in WATCHED:
                move = self._move(key, name)
                if move:
                    found.setdefault((key, move.before, move.after), move)
        return list(found.values())

    @cached_property
    def times(self) -> list[Move]:
        """The times that moved beyond noise; none on different hardware."""
        if not self.same_hardware:
            return []
        return [move for key in self.shared if (move := self._move(key, "seconds"))]

    def _move(self, key: Key, name: str) -> Move | None:
        """The move of a value beyond its noise, if any."""
        old, new = self.group(key)
        if name != "seconds" and old.maps == new.maps:
            return None
        first, second = old.values[name], new.values[name]
        if not len(first) or not len(second):
            return None
        before, after = float(first.mean()), float(second.mean())
        if before == after:
            return None
        if math.isinf(before) or math.isinf(after):
            return Move(key, name, before, after, 0.0, "infinite")
        noise, why = self._noise(key, name, first, second)
        return Move(key, name, before, after, noise, why) if abs(after - before) > noise else None

    def _noise(self, key: Key, name: str, first: Floats, second: Floats) -> tuple[float, str]:
        """How far the mean may move by chance, and how that is known."""
        size = max(abs(float(first.mean())), abs(float(second.mean())))
        if name != "seconds" and self.is_deterministic(key):
            if self.same_hardware:
                return 0.0, "deterministic"
            return ROUNDING * size, "deterministic, other hardware"
        if len(first) > 1 and len(second) > 1:
            return welch(first, second), f"95 % interval, {len(first)} and {len(second)} seeds"
        if name == "seconds":
            return max(ONE_TIME * size, LEAST_SECONDS), f"one seed: {ONE_TIME:.0%}"
        return ONE_SEED * size, f"one seed: {ONE_SEED:.0%}"

    def changed_maps(self) -> list[Key]:
        """Deterministic cells whose map is not bit for bit what it was, both folders having one."""
        return [
            key
            for key in self.shared
            if self.is_deterministic(key)
            and all(group.maps for group in self.group(key))
            and self.group(key)[0].maps != self.group(key)[1].maps
        ]


def welch(first: Floats, second: Floats) -> float:
    """Half of the 95 % confidence interval of the difference of two means (Welch 1947)."""
    parts = [float(np.var(values, ddof=1)) / len(values) for values in (first, second)]
    if sum(parts) == 0:
        return 0.0
    freedom = sum(parts) ** 2 / sum(
        part**2 / (len(values) - 1) for part, values in zip(parts, (first, second), strict=True)
    )
    return float(stats.t.ppf(0.975, freedom)) * math.sqrt(sum(parts))


def _environment(suites: Sequence[Contents]) -> dict[str, str]:
    """What the cells of a folder ran on: commit, machine, versions; all values where several."""
    runs = suites[0].runs
    used = {row.run for suite in suites for row in suite.rows}
    told: dict[str, set[str]] = {}
    for number, run in enumerate(runs):
        if number in used and isinstance(run, Mapping):
            packages = run.get("packages")
            entries = {name: run.get(name) for name in ("commit", *HARDWARE, "python")}
            entries |= packages if isinstance(packages, dict) else {}
            for name, value in entries.items():
                told.setdefault(str(name), set()).add(_words(value))
    return {name: ", ".join(sorted(values - {""})) for name, values in told.items()}


def _words(value: object) -> str:
    """An entry of an environment in words."""
    if isinstance(value, list):
        return ", ".join(map(str, value))
    return "" if value is None else str(value)
