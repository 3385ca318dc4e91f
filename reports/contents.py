"""What a results folder holds, as a report reads it: cells by suite, model and named method."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.cases.suites import SUITES
from benchmarks.metrics.grades import WHOLE, grade_of
from benchmarks.metrics.table import METRICS
from benchmarks.store import measuring
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.console import LONGEST_MESSAGE, printable
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, PointCloud
from reports.labels import Label, key_of, labels
from reports.ranking import TIMES, worst

ANGLE, AREA = "angle_difference_mean", "area_discrepancy_total"
FLIPPED, SPANNING = "flipped_fraction", "spanning_fraction"
FLIPPED_OFF_SEAM = f"{FLIPPED}_without_spanning"
WORST_PART = "part_area_ratio_min_without_spanning"
SHEETS = 12
"""Most models of a report in which each has figures of its own, and all pictures for them."""
ISOMETRIC = "symmetric_dirichlet"
SEAM = "seam_length"
OVERLAPPED, BIJECTIVE = "overlapped_fraction", "bijective"
POINT_ANGLE, POINT_AREA = "local_quasi_conformal_mean", "local_area_log_ratio_mean"
POINT_COLLISIONS, POINT_TEARS = "uv_collision_fraction", "spanning_point_fraction"


def suite_title(name: str) -> str:
    """The heading of a suite."""
    return SUITES[name].title if name in SUITES else name


@dataclass(frozen=True, eq=False)
class Contents:
    """The cells of one suite of a results folder.

    Attributes:
        store: where the maps are.
        suite: its name.
        rows: the latest row of each cell.
        labels: the label of each row, by its id.
        measured: one row a cell: case, label (short), seed, status, id, grade, TIMES, metrics.
        is_large: whether the folder holds more than SHEETS models, all suites together: then few
            have figures of their own, and pictures are small.
    """

    store: Store
    suite: str
    rows: tuple[ResultRow, ...]
    labels: Mapping[str, Label]
    measured: pd.DataFrame
    is_large: bool

    @cached_property
    def runs(self) -> list[dict[str, Any]]:
        """The environment of each run of the folder, its texts printable."""
        found: list[dict[str, Any]] = readable(self.store.environment()["runs"])
        return found

    @cached_property
    def cases(self) -> list[str]:
        """The models, in the order in which they ran."""
        return list(dict.fromkeys(row.case for row in self.rows))

    @cached_property
    def methods(self) -> list[Label]:
        """The methods, in the order of the tables."""
        seen = {label.short: label for label in labels(self.rows).values()}
        return list(seen.values())

    @cached_property
    def metrics(self) -> list[str]:
        """Names of the metrics that have a value here, in the order of METRICS."""
        return [name for name in METRICS if self.measured[name].notna().any()]

    def cell(self, case: str, label: Label) -> list[ResultRow]:
        """The rows of a model and a method, one a seed."""
        return [row for row in self.rows if row.case == case and self.labels[row.id] == label]

    def shown(self, case: str, label: Label) -> ResultRow | None:
        """The row whose map stands for a model and a method in figures.

        It is that of the smallest seed that gave a map; None where no seed did.
        """
        good = [row for row in self.cell(case, label) if row.status == "ok"]
        return min(good, key=lambda row: row.seed) if good else None

    def mesh(self, case: str) -> Mesh | None:
        """The mesh of a model, None where it is not stored or no mesh."""
        for row in self.rows:
            if row.case == case and row.surface_hash:
                try:
                    surface = self.store.surface(row)
                except InputError:
                    return None
                return surface if isinstance(surface, Mesh) else None
        return None

    def _components(self, case: str) -> int:
        """Connected components of a mesh; 1 where there is none."""
        surface = self.mesh(case)
        return surface.component_count if surface is not None else 1

    @cached_property
    def clouds(self) -> frozenset[str]:
        """The models that are clouds of points."""
        found = set()
        for case, row in {row.case: row for row in self.rows if row.surface_hash}.items():
            with suppress(InputError):
                if isinstance(self.store.surface(row), PointCloud):
                    found.add(case)
        return frozenset(found)

    def mapped(self, row: ResultRow) -> tuple[Mesh, Parameterization] | None:
        """The mesh of a cell and its map; None where one is damaged or they do not fit."""
        try:
            surface, result = self.store.surface(row), self.store.result(row)
        except InputError:
            return None
        if not isinstance(surface, Mesh) or not isinstance(result, Parameterization):
            return None
        return (surface, result) if len(result.corners) == len(surface.faces) else None

    def has_artist(self, case: str) -> bool:
        """Whether the model came with a map of its own."""
        hashes = {row.surface_hash for row in self.rows if row.case == case and row.surface_hash}
        return any(self.store.reference_path(name).exists() for name in hashes)

    @cached_property
    def atlases(self) -> frozenset[str]:
        """Short names of the methods that cut most surfaces into many charts: no rivals.

        Most and not any: a surface that is not manifold is split into components for some methods.
        Many beside the components of the surface, each of which needs a chart.
        """
        charts = self.means.pivot_table(index="case", columns="label", values="chart_count")
        parts = pd.Series({case: self._components(case) for case in charts.index}, dtype=float)
        few = np.maximum(charts.min(axis=1), parts)
        many = charts.gt(3 * few, axis=0).where(charts.notna())
        share = many.mean()
        return frozenset(str(name) for name in share.index[share > 1 / 2])

    @cached_property
    def partial(self) -> frozenset[str]:
        """Short names of the methods that map only a part of most surfaces: no rivals, either."""
        covered = self.means.pivot_table(index="case", columns="label", values="coverage")
        share = covered.lt(WHOLE).where(covered.notna()).mean()
        return frozenset(str(name) for name in share.index[share > 1 / 2])

    @property
    def unranked(self) -> frozenset[str]:
        """Short names of the methods that do not give one map of the whole surface."""
        return self.atlases | self.partial

    @cached_property
    def means(self) -> pd.DataFrame:
        """One row a (case, label): means over the seeds that gave a map, and counts.

        Columns: case, label, ok, tried, skipped, status, reason, preprocessing, grade (the worst of
        the seeds), TIMES, metrics. A skipped cell was not tried.
        """
        records = []
        for case in self.cases:
            for label in self.methods:
                rows = self.cell(case, label)
                if not rows:
                    continue
                ids = [row.id for row in rows if row.status == "ok"]
                values = self.measured[self.measured["id"].isin(ids)]
                bad = [row for row in rows if row.status != "ok"]
                record: dict[str, Any] = {
                    "case": case,
                    "label": label.short,
                    "ok": len(ids),
                    "tried": sum(row.status != "skipped" for row in rows),
                    "skipped": sum(row.status == "skipped" for row in rows),
                    "status": "ok" if ids else bad[0].status,
                    "reason": bad[0].reason if bad else "",
                    "preprocessing": rows[0].preprocessing,
                    "grade": worst(values["grade"].tolist()) or "",
                }
                for name in (*TIMES, *METRICS):
                    record[name] = values[name].mean() if len(values) else None
                records.append(record)
        frame = pd.DataFrame.from_records(records)
        numbers = [*TIMES, *METRICS]
        return frame.astype(dict.fromkeys(numbers, "float64"))

    @cached_property
    def records(self) -> dict[tuple[str, str], dict[str, Any]]:
        """The rows of `means` by (case, label)."""
        return {
            (record["case"], record["label"]): {str(k): v for k, v in record.items()}
            for record in self.means.to_dict("records")
        }


def number(record: Mapping[str, object] | None, name: str) -> float | None:
    """The value of a metric in a row of `Contents.means`, or None where there is none."""
    value = record.get(name) if record else None
    if not isinstance(value, int | float) or math.isnan(value):
        return None
    return float(value)


def _readable_row(row: ResultRow) -> ResultRow:
    """The row with every text in it printable (`parapoint.console.printable`)."""
    return dataclasses.replace(
        row,
        suite=printable(row.suite),
        case=printable(row.case),
        method=printable(row.method),
        params=readable(row.params),
        reason=printable(row.reason, LONGEST_MESSAGE),
        output="\n".join(printable(line, LONGEST_MESSAGE) for line in row.output.splitlines()),
        preprocessing=printable(row.preprocessing),
        report=readable(row.report),
        host=printable(row.host),
    )


def readable(value: Any) -> Any:
    """A value out of JSON with every text in it printable."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [readable(entry) for entry in value]
    if isinstance(value, Mapping):
        return {printable(str(key)): readable(entry) for key, entry in value.items()}
    return value


def contents(folder: Path) -> list[Contents]:
    """What `folder` holds, suite by suite.

    Raises:
        InputError: the folder is missing, holds no results, or is of a newer version.
    """
    if not folder.exists():
        raise InputError(f"{folder}: no such folder; `python -m benchmarks run` makes one")
    store = Store(folder)
    rows = [_readable_row(row) for row in store.rows()]
    if not rows:
        raise InputError(
            f"{folder} holds no results: it has no readable line in runs.jsonl; "
            "`python -m benchmarks run` writes them"
        )
    frame = measuring.metrics(store)
    is_large = len({row.case for row in rows}) > SHEETS
    found = []
    for suite in dict.fromkeys(row.suite for row in rows):
        own = tuple(row for row in rows if row.suite == suite)
        by_key = labels(own)
        by_id = {row.id: by_key[key_of(row)] for row in own}
        cases = {row.id: row.case for row in own}
        times = {name: {row.id: getattr(row, name) for row in own} for name in TIMES}
        part = frame[frame["id"].isin(by_id)].drop(columns=["method", "params", "suite"])
        part = part.assign(
            case=part["id"].map(cases),
            label=part["id"].map(lambda key, by_id=by_id: by_id[key].short),
            **{name: part["id"].map(of).astype("float64") for name, of in times.items()},
        )
        # A learned seam that faces span has no edges: 0 would read, and rank, as no seam at all.
        part.loc[part[SPANNING] > 0, [SEAM, "seam_excess"]] = math.nan
        cells: list[dict[str, Any]] = [
            {str(name): value for name, value in record.items()}
            for record in part.to_dict("records")
        ]
        grades = [grade_of(by_id[cell["id"]].method, cell) or "" for cell in cells]
        part["grade"] = pd.Series(grades, part.index, dtype=object)
        found.append(Contents(store, suite, own, by_id, part, is_large))
    return found
