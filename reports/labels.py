"""How tables and figures name a method with its parameters."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from benchmarks.metrics.grades import FROM_POINTS
from benchmarks.store.rows import SUBMITTED, ResultRow

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
    "unwrap(price=None)": ("Unwrap along the computed seam", "symmetric Dirichlet, one to one"),
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


def key_of(row: ResultRow) -> tuple[str, str]:
    """What has a label: a method, and its parameters as JSON."""
    return row.method, json.dumps(row.params, sort_keys=True)


def _rank(method: str) -> int:
    order = list(DISPLAY)
    return order.index(method) if method in order else order.index("fam")


def _words(name: str, value: object) -> str:
    """A parameter in words, "" where there is nothing to tell."""
    if value is None or value == "":
        return ""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _amount(name, value)
    told = BRANCHES.get(str(value)) if name == "branches" else None
    return told or str(value).replace("_", " ").replace("dirichlet", "Dirichlet")


def _amount(name: str, *values: float) -> str:
    """A number, or the range of some, with what it is a number of.

    A parameter whose name ends in "s" counts things: "20 iterations". Other numbers come after
    their name: "price 1"; but for times: "150.0 s budget".
    """
    is_time, is_count, words = name == "time_budget", name.endswith("s"), name.replace("_", " ")
    ends = dict.fromkeys((min(values), max(values)))
    text = " to ".join(
        f"{end:,}" if is_time or isinstance(end, int) else f"{end:g}" for end in ends
    )
    if is_time:
        return f"{text} s budget"
    if is_count:
        return f"{text} {words.removesuffix('s') if max(values) == 1 else words}"
    return f"{words} {text}"


def _told(rows: Sequence[ResultRow], name: str) -> str:
    """What the rows of one method say of parameter `name`: its value, or the range it took."""
    values: list[Any] = []
    for row in rows:
        value = row.report.get(name)
        value = row.params.get(name) if value is None or isinstance(value, list | dict) else value
        if value is not None and value not in values:
            values.append(value)
    if len(values) > 1 and all(isinstance(value, int | float) for value in values):
        return _amount(name, *values)
    return " / ".join(_words(name, value) for value in values)


def _in_print(method: str, params: Mapping[str, Any], submitted: str | None) -> tuple[str, str]:
    """The name in print, and what stands in its detail whatever the parameters are."""
    if submitted is not None:
        return submitted, "submitted maps"
    variants = [f"{method}({name}={value})" for name, value in params.items()]
    return next((DISPLAY[one] for one in (*variants, method) if one in DISPLAY), (method, ""))


def labels(rows: Iterable[ResultRow]) -> dict[tuple[str, str], Label]:
    """The label of each (method, params) in `rows`, in the order of the tables."""
    by_key: dict[tuple[str, str], list[ResultRow]] = {}
    for row in rows:
        by_key.setdefault(key_of(row), []).append(row)
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
        siblings = [params[other] for other in keys if in_print[other] == in_print[key]]
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
