"""What commands write: a surface with the map of a fitted model, in the unit square."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.estimator import Estimator
from parapoint.files.mesh_writers import write_obj
from parapoint.files.point_writers import write_points
from parapoint.files.targets import checked_target
from parapoint.surfaces.sampling import mean_spacing
from parapoint.surfaces.spanning import Transform, opened, spanning_edges
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

ENDINGS = (".obj", ".ply", ".npz")
"""Endings of files that a map can be written to."""


def target(out: str, surface: str, *, force: bool) -> str:
    """The file to write for `out`, checked before any work (`parapoint.files.targets`).

    Args:
        out: the file that the user named.
        surface: the file that is read.
        force: replace whatever is there.

    Raises:
        InputError: its ending is none of ENDINGS, or it cannot or may not be written.
    """
    ending = Path(out).suffix.lower()
    if ending not in ENDINGS:
        raise InputError(f"{out}: cannot write this ending; take {', '.join(ENDINGS)}")
    sides = (".mtl", ".png") if ending == ".obj" else ()
    return str(checked_target(out, sides=sides, inputs=[surface], force=force))


def write(
    model: Estimator, surface: Surface, out: str, texture: npt.NDArray[np.uint8] | None
) -> dict[str, object]:
    """Map a surface into the unit square and write it; what was written, as facts."""
    points = surface.vertices if isinstance(surface, Mesh) else surface.points
    transform = _in_unit_square(model)
    uv = transform(points)
    facts: dict[str, object] = {"file": out, "mapped_points": len(points)}
    if isinstance(surface, Mesh) and Path(out).suffix.lower() == ".obj":
        spans = spanning_edges(surface, uv, transform, mean_spacing(model.points_))
        parameterization = opened(surface, uv, spans)
        facts["spanning_faces"] = int((parameterization.corners != surface.faces).any(1).sum())
        write_obj(out, surface, parameterization, texture)
    else:
        cloud = surface if isinstance(surface, PointCloud) else PointCloud(points)
        write_points(out, cloud, uv)
    return facts


def _in_unit_square(model: Estimator) -> Transform:
    """The model's map, scaled so that the images of the fitted points fill the unit square."""
    known = model.transform(model.points_)
    low, side = known.min(axis=0), np.ptp(known, axis=0).max()
    return lambda points: np.asarray((model.transform(points) - low) / side)
