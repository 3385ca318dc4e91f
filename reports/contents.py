"""What a results folder holds, as a report reads it: cells by suite, model and named method."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.cases.suites import SUITES
from benchmarks.metrics.grades import FROM_POINTS, grade_of
from benchmarks.metrics.table import METRICS
from benchmarks.store import measuring
from benchmarks.store.results import Store
from benchmarks.store.rows import SUBMITTED, ResultRow
from parapoint.console import LONGEST_MESSAGE, printable
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, PointCloud
from reports.ranking import TIMES, worst

ANGLE, AREA = "angle_difference_mean", "area_discrepancy_total"
FLIPPED, SPANNING = "flipped_fraction", "spanning_fraction"
FLIPPED_OFF_SEAM = f"{FLIPPED}_without_spanning"
WORST_PART = "part_area_ratio_min_without_spanning"
WHOLE = 0.95
"""Share of a surface that a map must cover to be ranked among maps of the whole."""
SHEETS = 12
"""Most models of a report in which each has figures of its own, and all pictures for them."""
ISOMETRIC = "symmetric_dirichlet"
SEAM = "seam_length"
OVERLAPPED, BIJECTIVE = "overlapped_fraction", "bijective"
POINT_ANGLE, POINT_AREA = "local_quasi_conformal_mean", "local_area_log_ratio_mean"
POINT_COLLISIONS, POINT_TEARS = "uv_collision_fraction", "spanning_point_fraction"

DISPLAY: dict[str, tuple[str, str]] = {
    "tutte": ("Tutte", "uniform weights"),
    "harmonic": ("Harmonic", "cotangent weights"),
    "mean_value": ("Mean value", "mean-value weights"),
    "lscm": ("LSCM", "linear conformal energy"),
    "bff": ("BFF", "boundary first, conformal"),
    "abf": ("ABF++", "angles nearest to those in space"),
    "arap": ("ARAP", "as-rigid-as-possible energy"),
    "slim": ("SLIM", ""),
    "smith_schaefer": ("Smith and Schaefer", "symmetric Dirichlet, one to one"),
    "geometry_image": ("Geometry image", "least stretch on a square"),
    "xatlas": ("xatlas", "many charts"),
    "uvatlas": ("UVAtlas", "many charts"),
    "uvunwrap": ("uvunwrap", "many charts"),
    "blender_angle_based": ("Blender angle-based", "angles nearest to those in space"),
    "blender_conformal": ("Blender conformal", "linear conformal energy"),
    "blender_minimum_stretch": ("Blender minimum stretch", "symmetric Dirichlet"),
    "blender_smart_project": ("Blender smart project", "many charts"),
    "meshlab_lscm": ("MeshLab LSCM", "linear conformal energy"),
    "meshlab_harmonic": ("MeshLab harmonic", "cotangent weights"),
    "meshlab_voronoi": ("MeshLab Voronoi atlas", "many charts"),
    "meshlab_triangles": ("MeshLab triangles", "a chart for each face"),
    "external": ("External", ""),
    "meshed": ("Meshed", ""),
    "textured": ("Textured", ""),
    "foldingnet": ("FoldingNet", ""),
    "atlasnet": ("AtlasNet", ""),
    "diffsr": ("DiffSR", ""),
    "elestruc": ("EleStruc", ""),
    "gtif": ("GTIF", ""),
    "tearingnet": ("TearingNet", ""),
    "flattening_net": ("Flattening-Net", ""),
    "reggeonet": ("RegGeoNet", ""),
    "nsm": ("Neural Surface Maps", ""),
    "fam": ("FAM", ""),
    "nuvo": ("Nuvo", ""),
    "artist+slim": ("Artist's cut + SLIM", ""),
    "seamster": ("Seamster + SLIM", ""),
    "da_wand": ("DA-Wand", "a region around a triangle"),
    "erickson_har_peled": ("Erickson and Har-Peled + SLIM", "shortest cut"),
    "automatic+slim": ("Automatic cut + SLIM", ""),
    "unwrap": ("Unwrap", "symmetric Dirichlet, one to one"),
    "parapoint+slim": ("Unwrap", "symmetric Dirichlet, one to one"),
    "computed": ("Computed map", ""),
    "parapoint(preset=learned)": ("ParaPoint, our training", ""),
    "parapoint": ("ParaPoint", ""),
}
"""Name of a method in print and, where its parameters do not say it, what it minimises.

The order is that of the tables; methods from elsewhere stand between, ParaPoint last.
"""

TOLD = (
    "reconstruction",
    "flattening",
    "preset",
    "energy",
    "loss",
    "iterations",
    "points",
    "time_budget",
)
"""Parameters, or entries of a method's report, that are part of its name in a table."""


BRANCHES = {"both": "both branches", "2d": "2D→3D→2D alone", "3d": "3D→2D→3D alone"}
"""The ablations of ParaPoint's branches in words."""


@dataclass(frozen=True)
class Label:
    """A method with its parameters, as tables and figures name it.

    Attributes:
        method: registry name.
        params: its parameters as JSON, keys sorted.
        name: the name in print, such as "SLIM".
        detail: energy, iterations and other things told, such as "conformal, 20 iterations".
        short: a name for axes and column heads, no other label of the folder has it.
    """

    method: str
    params: str
    name: str
    detail: str
    short: str

    @property
    def parameters(self) -> dict[str, Any]:
        """Its parameters by name."""
        found: dict[str, Any] = json.loads(self.params)
        return found

    @property
    def input(self) -> str:
        """What it reads: a "mesh", or the "points" alone."""
        return "points" if self.method in FROM_POINTS else "mesh"

    @property
    def text(self) -> str:
        """Name and detail."""
        return f"{self.name} ({self.detail})" if self.detail else self.name


def _key(row: ResultRow) -> tuple[str, str]:
    return row.method, json.dumps(row.params, sort_keys=True)


def _rank(method: str) -> int:
    order = list(DISPLAY)
    return order.index(method) if method in order else order.index("fam")


def _words(name: str, value: object) -> str:
    """A parameter in words, "" where there is nothing to tell."""
    if value is None or value == "":
        return ""
    if isinstance(value, int | float) and not isinstance(value, bool):
        unit = {"time_budget": "s budget"}.get(name, name.replace("_", " "))
        return f"{value:,} {unit.removesuffix('s') if value == 1 else unit}"
    told = BRANCHES.get(str(value)) if name == "branches" else None
    return told or str(value).replace("_", " ").replace("dirichlet", "Dirichlet")


def _told(rows: Sequence[ResultRow], name: str) -> str:
    """What the rows of one method say of parameter `name`: its value, or the range it took."""
    values: list[Any] = []
    for row in rows:
        value = row.report.get(name)
        value = row.params.get(name) if value is None or isinstance(value, list | dict) else value
        if value is not None and value not in values:
            values.append(value)
    if len(values) > 1 and all(isinstance(value, int | float) for value in values):
        return f"{min(values):,} to {_words(name, max(values))}"
    return " / ".join(_words(name, value) for value in values)


def _in_print(method: str, params: Mapping[str, Any], submitted: str | None) -> tuple[str, str]:
    """The name in print, and what stands in its detail whatever the parameters are."""
    if submitted is not None:
        return submitted, "submitted maps"
    preset = f"{method}(preset={params.get('preset')})"
    return DISPLAY.get(preset, DISPLAY.get(method, (method, "")))


def labels(rows: Iterable[ResultRow]) -> dict[tuple[str, str], Label]:
    """The label of each (method, params) in `rows`, in the order of the tables."""
    by_key: dict[tuple[str, str], list[ResultRow]] = {}
    for row in rows:
        by_key.setdefault(_key(row), []).append(row)
    keys = sorted(by_key, key=lambda key: (_rank(key[0]), key[0]))  # stable: else as they ran
    params = {
        key: {n: v for n, v in by_key[key][0].params.items() if n != "device"} for key in keys
    }
    submitted = {key: str(params[key].pop("name", "")) for key in keys if key[0] == SUBMITTED}
    in_print = {key: _in_print(key[0], params[key], submitted.get(key)) for key in keys}
    found: dict[tuple[str, str], Label] = {}
    for key in keys:
        method = key[0]
        name, fixed = in_print[key]
        siblings = [params[other] for other in keys if in_print[other] == in_print[key] != key]
        differing = [
            entry
            for entry, value in params[key].items()
            if any(other.get(entry) != value for other in siblings)
        ]
        told = [_told(by_key[key], entry) for entry in dict.fromkeys([*TOLD, *differing])]
        short, rivals = name, siblings
        for entry in sorted(differing, key=lambda entry: entry != "charts"):  # which tell most
            fewer = [other for other in rivals if other.get(entry) == params[key][entry]]
            if len(fewer) < len(rivals):
                short = f"{short} {_words(entry, params[key][entry])}".rstrip()
                rivals = fewer
        new = [part for part in told if part not in {"", method} and part not in fixed]
        detail = ", ".join(filter(None, [fixed, *new]))
        found[key] = Label(method, key[1], name, detail, short)
    taken: dict[str, int] = {}
    for key, label in found.items():
        taken[label.short] = taken.get(label.short, 0) + 1
        if taken[label.short] > 1:
            unique = f"{label.short} #{taken[label.short]}"
            found[key] = dataclasses.replace(label, short=unique)
    return found


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
        """The row whose map stands for a model and a method in figures: the first seed's, if ok."""
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
        """
        charts = self.means.pivot_table(index="case", columns="label", values="chart_count")
        many = charts.gt(3 * charts.min(axis=1).clip(lower=1), axis=0).where(charts.notna())
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
        by_id = {row.id: by_key[_key(row)] for row in own}
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
