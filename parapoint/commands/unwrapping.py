"""`unwrap` of a mesh: the map, the file it is written to, and what is said of it."""

from __future__ import annotations

import logging
import math
import time
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np

from parapoint import clock
from parapoint.commands.given_seams import read_seams
from parapoint.commands.mesh_output import MeshOutput
from parapoint.commands.output import Y_UP
from parapoint.commands.progress import Tell, untold
from parapoint.commands.telling import ADVICE_OF_MESHES, warn
from parapoint.errors import InputError
from parapoint.fitting import Progress
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import IntArray, Mesh
from parapoint.textures.packing import packed
from parapoint.textures.preview import write_preview
from parapoint.unwrapping.given import mended_along
from parapoint.unwrapping.quality import quality
from parapoint.unwrapping.unwrap import Unwrap

logger = logging.getLogger("parapoint")

SECONDS_OF_A_COMPONENT, SECONDS_OF_A_FACE, GROWTH = 0.07, 7e-5, 1.2
"""What unwrapping a component takes, for the progress bar: the first number, and the second times
the faces to the power of the third, are the seconds of one idle core, 10 for 20,000 faces and 70
for 100,000."""


@dataclass(frozen=True)
class Request:
    """What `unwrap` was asked of a mesh, beside what is to be written.

    Attributes:
        method: how the mesh is unwrapped.
        border: width that stays free around the map, in sides of the unit square.
        seed: of every random draw.
        seams: file of the edges to cut along, or None for seams of the method's own.
        preview: a PNG file for a picture of the surface beside its layout, or None.
        per_vertex: whether each vertex gets one uv, whatever the seams.
    """

    method: Unwrap
    border: float
    seed: int = 0
    seams: str | None = None
    preview: Path | None = None
    per_vertex: bool = False


def unwrap_mesh(
    mesh: Mesh, request: Request, output: MeshOutput, tell: Tell = untold
) -> dict[str, object]:
    """Unwrap a mesh and write it; the facts of what was done.

    Args:
        mesh: what is unwrapped.
        request: how.
        output: what is written.
        tell: is called with each `Progress`.

    Raises:
        InputError: the mesh cannot be unwrapped, or a seam is none of its edges.
        click.ClickException: no map without flips was found.
    """
    began = time.perf_counter()
    seconds = request.method.time_budget
    at_most = "" if seconds is None else f" (at most {seconds:g} s)"
    remaining = expected(request.method, np.bincount(mesh.welded.face_components))
    tell(Progress(f"cutting and flattening{at_most}", remaining=remaining))
    made = _made(mesh, request, output)
    tell(Progress("packing"))
    placed = packed(Charted(mesh, made), request.border)
    picture = output.picture(placed, tell)
    if request.per_vertex:
        placed = _one_each(placed)
    tell(Progress("writing"))
    written = output.write(placed, picture)
    if request.preview is not None:
        is_y_up = output.source.suffix.lower() in Y_UP
        write_preview(request.preview, placed, picture[..., :3], is_y_up=is_y_up)
    tell(Progress("measuring"))
    found = quality(placed, output.texture)
    facts: dict[str, object] = {"file": str(output.out), "faces": len(mesh.faces), **found.facts()}
    if "duplicate" in str(made.report.get("steps", "")):
        facts["overlap"] = "unknown"  # a face that was left out may lie on another
    parts = [part for part in _parts(made) if "end_energy" in part]
    facts["energy"] = round(max(float(str(part["end_energy"])) for part in parts), 4)
    facts["components"] = mesh.welded.component_count
    facts["welded"] = int(mesh.referenced.sum() - mesh.welded.referenced.sum())
    facts |= written
    facts["seconds"] = round(time.perf_counter() - began, 1)
    _warn_of_bound(facts, request)
    if request.per_vertex:
        del facts["energy"]  # of the map along its seams, which is not written
    warn(facts, _advice(request))
    return facts


def _one_each(placed: Charted) -> Charted:
    """The mesh with one of the uvs of each vertex; of a vertex without faces the middle."""
    mesh, held = placed
    uv = np.full((len(mesh.vertices), 2), 0.5)
    uv[mesh.faces[::-1]] = held.uv[held.corners[::-1]]
    return Charted(mesh, Parameterization(uv, mesh.faces))


def _advice(request: Request) -> dict[str, str]:
    """What helps where faces overlap, and where parts are starved, as the map was asked for."""
    advice = dict(ADVICE_OF_MESHES)
    if request.per_vertex:
        advice |= {"overlap": "with --per-vertex, faces across a seam span the map"}
    if request.seams is not None:
        advice |= {"starved": "a longer seam helps"}
    elif request.method.max_distortion is not None:
        advice |= {"starved": "a longer seam helps, as with a lower --max-distortion"}
    elif request.method.distortion == "conformal":
        advice |= {"starved": "--distortion balanced helps, or isometric"}
    return advice


def expected(method: Unwrap, faces: IntArray) -> float | None:
    """Seconds that unwrapping should take; None where only a bound on energy ends it.

    No method takes longer than its time budget.

    Args:
        method: how the mesh is unwrapped.
        faces: how many faces each of its components has.
    """
    if method.max_distortion is not None:
        return method.time_budget
    seconds = float((SECONDS_OF_A_COMPONENT + SECONDS_OF_A_FACE * faces**GROWTH).sum())
    return seconds if method.time_budget is None else min(seconds, method.time_budget)


def _made(mesh: Mesh, request: Request, output: MeshOutput) -> Parameterization:
    """The map of a mesh, as it was asked for.

    Raises:
        InputError, click.ClickException: see `unwrap_mesh`.
    """
    seams = None if request.seams is None else read_seams(request.seams, mesh)
    try:
        if seams is None:
            return request.method.unwrapped(mesh, seed=request.seed)
        seconds = request.method.time_budget
        deadline = math.inf if seconds is None else clock.worked() + seconds
        return mended_along(mesh, seams, deadline)
    except (UnsupportedError, InputError) as error:
        raise InputError(f"{output.source}: {error}") from None
    except FlatteningError as error:
        raise click.ClickException(f"{output.source}: {error}") from error


def _parts(made: Parameterization) -> list[dict[str, object]]:
    parts = made.report["parts"]
    assert isinstance(parts, list)
    return parts


def _warn_of_bound(facts: dict[str, object], request: Request) -> None:
    """A line of advice where the energy is above what was asked for."""
    bound = request.method.max_distortion
    if bound is not None and float(str(facts["energy"])) > bound:
        logger.warning(
            "%s: the energy is %s, above --max-distortion %g: give more time, or a higher bound",
            facts["file"],
            facts["energy"],
            bound,
        )
