"""`python -m benchmarks score`: every metric of an existing UV map, whatever tool made it."""

from __future__ import annotations

import json
from pathlib import Path

import click
import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from benchmarks.metrics import evaluation
from benchmarks.metrics.grades import BOUNDS, grade
from benchmarks.metrics.metric import GROUPS, WITHOUT_SPANNING
from benchmarks.metrics.state import MapState
from benchmarks.metrics.table import METRICS
from benchmarks.store.submissions import difference
from parapoint.commands.memory import memory_option
from parapoint.console import terminal
from parapoint.errors import InputError
from parapoint.files.reading import faults_of, has_faces, read_parameterized, read_point_map
from parapoint.files.targets import checked_picture
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray

WORST = 5
"""Number of faces that are listed as the worst by angle, and as the worst by area."""
WIDTH = 160
"""Width of the tables in characters if the output is not a terminal."""


@click.command(no_args_is_help=True)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--reference", type=click.Path(path_type=Path), help="Another map of the same faces: its UV."
)
@memory_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object {metric: value}.")
@click.option(
    "--heatmap", type=click.Path(path_type=Path), metavar="OUT.png", help="Draw the distortion."
)
def score(file: Path, *, reference: Path | None, as_json: bool, heatmap: Path | None) -> None:
    """Grade and metrics of any UV map.

    FILE is an OBJ with vt, a GLB, a PLY or an NPZ, of a mesh or a cloud. Polygons are triangulated
    first; faces are the triangles, numbered from 0 in the file's order. JSON has no infinity:
    an infinite value is the string "inf".
    """
    given = [file] if reference is None else [file, reference]
    picture = None if heatmap is None else checked_picture(heatmap, inputs=given)
    if not has_faces(file):
        if reference is not None or heatmap is not None:
            raise InputError(f"{file}: --reference and --heatmap need a mesh, not a point cloud")
        cloud, image = read_point_map(file)
        with faults_of(file):
            values = evaluation.evaluate_points(cloud, image)
        title = f"{file}: {len(cloud.points):,} points"
        state = None
    else:
        state = map_state(file, reference)
        values = evaluation.values(state)
        title = f"{file}: {summary(state)}"
        if picture is not None:
            from benchmarks.commands.heatmap import write_heatmap

            write_heatmap(state, picture, title=file.name)
    found = grade(values, of_cloud=state is None)
    if as_json:
        print(json.dumps({"grade": found, **json_values(values)}, allow_nan=False))
        return
    console = terminal()
    if not console.is_terminal:
        console = Console(width=WIDTH, force_terminal=False)
    console.print(Text(title, style="bold"))
    console.print(Text(f"grade: {found} ({BOUNDS})"))
    for table in tables(values):
        console.print(table)
    if state is not None:
        console.print(worst_table(state))


def map_state(file: Path, reference: Path | None = None) -> MapState:
    """The state of the map in `file`, with the map in `reference` to compare it to.

    Raises:
        InputError: a file cannot be read; the map has no UV area; the reference has other faces.
    """
    mesh, parameterization = read_parameterized(file)
    state = MapState(mesh, parameterization)
    with faults_of(file):
        if not (np.abs(state.triangles.uv_area) > 0).any():
            raise InputError("every face has zero UV area; there is no map to score")
    if reference is None:
        return state
    other_mesh, other = read_parameterized(reference)
    if difference(mesh, other_mesh):
        raise InputError(
            f"{reference}: has other faces than {file} ({len(other_mesh.faces)} and "
            f"{len(mesh.faces)}); a reference is another map of the same mesh, in the same order"
        )
    return MapState(mesh, parameterization, Parameterization(other.uv, other.corners))


def json_values(values: dict[str, float]) -> dict[str, float | str]:
    """The values as strict JSON can hold them: infinity becomes "inf"."""
    return {name: value if np.isfinite(value) else str(value) for name, value in values.items()}


def summary(state: MapState) -> str:
    """The map in one line."""
    distortion = state.distortion
    middle = float(np.median(distortion.quasi_conformal)) if len(distortion.faces) else np.inf
    faces, topology = len(state.mesh.faces), state.mesh.topology
    welded = f"; {state.welded:,} doubled vertices welded" if state.welded else ""
    sampled = "; overlaps estimated from a sample" if state.validity.overlaps.sampled else ""
    return f"{faces:,} faces, surface: {topology}{welded}{sampled}; median σ1/σ2 {middle:.4g}"


def tables(values: dict[str, float]) -> list[Table]:
    """One table for each group of metrics. If faces span a seam, a column leaves them out."""
    spans = values.get("spanning_fraction", values.get("spanning_point_fraction", 0.0)) > 0
    found = []
    for group, title in GROUPS.items():
        rows = [
            metric
            for name, metric in METRICS.items()
            if metric.group == group and name in values and not name.endswith(WITHOUT_SPANNING)
        ]
        if not rows:
            continue
        twice = spans and any(row.name + WITHOUT_SPANNING in values for row in rows)
        table = _titled(f"{group}: {title}")
        table.add_column("metric", no_wrap=True)
        for heading in ("value", *["without spanning"] * twice, "ideal"):
            table.add_column(heading, justify="right", no_wrap=True)
        for heading in ("better", "what it is", "weighting"):
            table.add_column(heading)
        for row in rows:
            cells = [row.name, number(values[row.name])]
            if twice:
                without = values.get(row.name + WITHOUT_SPANNING)
                cells.append("" if without is None else number(without))
            cells.append("" if row.ideal is None else f"{row.ideal:g}")
            table.add_row(*map(Text, [*cells, row.better, row.heading, row.weighting]))
        found.append(table)
    return found


def _titled(title: str) -> Table:
    """An empty table with a title."""
    return Table(title=title, title_justify="left", title_style="bold", box=box.SIMPLE_HEAD)


def number(value: float) -> str:
    """A value with five significant digits; a whole number with all of its digits."""
    return f"{value:.0f}" if abs(value) < 1e15 and value == round(value) else f"{value:.5g}"


def worst_faces(state: MapState) -> tuple[IntArray, IntArray]:
    """The WORST faces by angle and the WORST faces by area, the worst first."""
    distortion = state.distortion

    def worst(values: FloatArray) -> IntArray:
        return distortion.faces[np.argsort(-values, kind="stable")[:WORST]]

    return worst(distortion.quasi_conformal), worst(distortion.area_log_ratio)


def worst_table(state: MapState) -> Table:
    """The worst faces, each with its distortion, its chart and its faults."""
    distortion = state.distortion
    row_of = np.full(len(state.mesh.faces), -1)
    row_of[distortion.faces] = np.arange(len(distortion.faces))
    table = _titled("worst faces, numbered from 0 in the file's order")
    for heading in ("worst by", "face", "vertices", "chart", "σ1/σ2", "a/A"):
        table.add_column(heading, justify="left" if heading == "worst by" else "right")
    table.add_column("angle difference")
    table.add_column("notes")
    flags = {
        "flipped": state.validity.flipped,
        "degenerate in UV": state.triangles.degenerate_uv,
        "overlaps": state.validity.overlaps.overlapped,
        "spans a seam": state.spanning,
    }
    charts = state.parameterization.charts()
    for reason, faces in zip(("angle", "area"), worst_faces(state), strict=True):
        for face in faces:
            row = row_of[face]
            table.add_row(
                reason,
                str(face),
                " ".join(map(str, state.mesh.faces[face])),
                str(charts[face]),
                number(float(distortion.quasi_conformal[row])),
                number(float(distortion.area_ratio[row])),
                number(float(distortion.angle_difference[row].max())),
                ", ".join(name for name, mask in flags.items() if mask[face]),
            )
        table.add_section()
    return table
