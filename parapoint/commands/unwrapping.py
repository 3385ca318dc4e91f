"""`unwrap` of a mesh: the map, the file it is written to, and what is said of it."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from parapoint.errors import InputError
from parapoint.files.mesh_writers import write_material, write_obj, write_textured
from parapoint.files.obj_rewriting import libraries, rewrite_obj
from parapoint.files.point_writers import write_points
from parapoint.files.reading import Polygons
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.areas import MOST_STARVED
from parapoint.surfaces.components import components
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, PointCloud
from parapoint.textures.checkerboard import checkerboard
from parapoint.textures.placing import BORDER, Placing
from parapoint.textures.preview import write_preview
from parapoint.unwrapping.given import unwrapped_along
from parapoint.unwrapping.quality import Quality, quality
from parapoint.unwrapping.unwrap import Unwrap

logger = logging.getLogger("parapoint")


@dataclass(frozen=True)
class Request:
    """What `unwrap` was asked of a mesh.

    Attributes:
        source: the file that was read.
        out: the file to write.
        texture: texels along a side of the texture.
        border: width that stays free around the map, in sides of the unit square.
        method: how the mesh is unwrapped.
        seed: of every random draw.
        seams: file of the edges to cut along, or None for seams of the method's own.
        largest: whether the largest component alone is unwrapped and written.
        per_vertex: whether each vertex is to have one uv.
        preview: a PNG file for a picture of the surface beside its layout, or None.
    """

    source: str
    out: str
    texture: int
    border: float
    method: Unwrap
    seed: int = 0
    seams: str | None = None
    largest: bool = False
    per_vertex: bool = False
    preview: Path | None = None


def border_of(margin: int | None, texture: int) -> float:
    """The width that stays free around the map, in sides of the unit square."""
    return BORDER if margin is None else margin / texture


def unwrap_mesh(given: Polygons, request: Request) -> dict[str, object]:
    """Unwrap a mesh and write it; the facts of what was done.

    Raises:
        InputError: the mesh cannot be unwrapped, or a seam is none of its edges.
        click.ClickException: no map without flips was found.
    """
    began = time.perf_counter()
    mesh = given.mesh
    places: IntArray | None = given.places
    if request.largest and mesh.component_count > 1:
        largest = components(mesh)[0]
        assert isinstance(largest, Mesh)
        mesh, places = largest, None
    try:
        if request.seams is None:
            made = request.method.unwrapped(mesh, seed=request.seed)
        else:
            edges = read_seams(request.seams, mesh)
            seconds = request.method.time_budget
            deadline = math.inf if seconds is None else time.monotonic() + seconds
            made = unwrapped_along(mesh, edges, deadline)
    except (UnsupportedError, InputError) as error:
        raise InputError(f"{request.source}: {error}") from None
    except FlatteningError as error:
        raise click.ClickException(f"{request.source}: {error}") from error
    placed = Placing.smallest(made.uv, request.border).of(Charted(mesh, made))
    found = quality(placed, request.texture)
    facts: dict[str, object] = {"file": request.out, "faces": len(mesh.faces), **found.facts()}
    parts = [part for part in _parts(made) if "end_energy" in part]
    facts["overlap"] = "none" if all(part["bijective"] for part in parts) else "some"
    if found.flipped or "duplicate" in str(made.report.get("steps", "")):
        facts["overlap"] = "unknown"  # a face that was turned or left out may lie on another
    facts["energy"] = round(max(float(str(part["end_energy"])) for part in parts), 4)
    facts["components"] = mesh.component_count
    facts |= _written(placed, places, given.extras, request)
    if request.preview is not None:
        write_preview(request.preview, placed, checkerboard())
    facts["seconds"] = round(time.perf_counter() - began, 1)
    _warn(found, facts, request)
    return facts


def read_seams(path: str, mesh: Mesh) -> IntArray:
    """(S, 2) the edges in a text file: two vertex numbers a line, counted from 1 as OBJ does.

    Raises:
        InputError: the file cannot be read, or a line is no edge of the mesh.
    """
    known = {tuple(edge) for edge in mesh.edges.tolist()}
    found = []
    for number, line in enumerate(Path(path).read_text(errors="replace").splitlines(), start=1):
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        try:
            one, other = (int(word) - 1 for word in words)
        except ValueError:
            raise InputError(f"{path}: line {number} is not two vertex numbers") from None
        if (min(one, other), max(one, other)) not in known:
            raise InputError(f"{path}: line {number} is no edge of the mesh")
        found.append((one, other))
    if not found:
        raise InputError(f"{path}: has no edge")
    return np.array(found, dtype=np.int64)


def lines(facts: dict[str, object]) -> str:
    """The facts in a few lines for a reader."""
    of = {name: str(value) for name, value in facts.items()}
    angles = f"angles off by {of['angle_mean']}° in the mean, {of['angle_worst']}° at worst"
    stretch = f"stretch {of['stretch_mean']} in the mean, {of['stretch_worst']} at worst"
    part = f"smallest part at {of['smallest_part']} of its fair area"
    charts = "1 chart" if of["charts"] == "1" else f"{of['charts']} charts"
    seam = f"{charts}, seam {of['seam']} of the square root of the area"
    texels = f"{of['texels_per_unit']} texels per unit, {of['filled']} of the square filled"
    return "\n".join(
        [
            f"{of['file']}: {of['faces']} faces in {of['seconds']} s",
            f"{angles}; {stretch}",
            f"{part}; {of['flipped']} flipped faces, overlap: {of['overlap']}",
            f"{seam}; {texels}",
        ]
    )


def _parts(made: Parameterization) -> list[dict[str, object]]:
    parts = made.report["parts"]
    assert isinstance(parts, list)
    return parts


def _written(
    placed: Charted, places: IntArray | None, extras: tuple[str, ...], request: Request
) -> dict[str, object]:
    """Write the mesh with its map; facts of the writing."""
    out, source = Path(request.out), Path(request.source)
    ending = out.suffix.lower()
    is_copy = ending == ".obj" and source.suffix.lower() == ".obj" and places is not None
    if extras and not (is_copy or request.per_vertex):
        logger.warning(
            "%s: only positions, triangles and new UVs are written; left out: %s. An OBJ file "
            "written as OBJ keeps them",
            out,
            ", ".join(extras),
        )
    if request.per_vertex:
        write_points(out, PointCloud(placed.mesh.vertices), _one_each(placed))
    elif is_copy:
        assert places is not None
        return {"polygons_split": _copied(source, out, placed, places)}
    elif ending == ".npz":
        write_charted(out, placed)
    elif ending == ".obj":
        write_obj(out, *placed, checkerboard())
    else:
        write_textured(out, placed, checkerboard(pixels=max(1, request.texture // 32)))
    return {}


def write_charted(path: Path, placed: Charted) -> None:
    """Write arrays `vertices`, `faces`, `uv` and `corners`, rows of `uv`, as .npz."""
    from parapoint.files.targets import complete_file

    mesh, held = placed
    with complete_file(path) as file:
        np.savez(file, vertices=mesh.vertices, faces=mesh.faces, uv=held.uv, corners=held.corners)


def _copied(source: Path, out: Path, placed: Charted, places: IntArray) -> int:
    """Write the OBJ file anew with the map; how many polygons the seam runs through."""
    named, pictures = libraries(source)
    if pictures:
        logger.warning(
            "%s: the pictures of its materials were drawn for other UVs, so the material library "
            "is left out; the names of the materials stay",
            source,
        )
    material = None if named else write_material(out, checkerboard())
    split = rewrite_obj(
        source, out, placed.map, places, material=material, keeps_libraries=not pictures
    )
    if split:
        logger.warning("%s: the seam runs through %d polygons: they became triangles", out, split)
    return split


def _one_each(placed: Charted) -> FloatArray:
    """(V, 2) one of the uvs of each vertex; of a vertex without faces the middle."""
    uv = np.full((len(placed.mesh.vertices), 2), 0.5)
    uv[placed.mesh.faces[::-1]] = placed.map.uv[placed.map.corners[::-1]]
    return uv


def _warn(found: Quality, facts: dict[str, object], request: Request) -> None:
    """A line of advice for each bound that is passed."""
    bound = request.method.max_distortion
    if bound is not None and float(str(facts["energy"])) > bound:
        logger.warning(
            "%s: the energy is %s, above --max-distortion %g: give more time, or a higher bound",
            request.out,
            facts["energy"],
            bound,
        )
    if found.flipped or facts["overlap"] != "none":
        logger.warning(
            "%s: %d faces are flipped, overlap: %s; faces without area or a defective mesh can be "
            "the cause: clean it, or crop it",
            request.out,
            found.flipped,
            facts["overlap"],
        )
    if found.starved > MOST_STARVED:
        logger.warning(
            "%s: %.1f %% of the surface has less than a quarter of its fair area: a longer seam "
            "helps, as with --seam-price 0.03",
            request.out,
            100 * found.starved,
        )
