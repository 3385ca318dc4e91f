"""What commands write: a surface with the map of a fitted model, in the unit square."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.estimator import Estimator
from parapoint.files.point_writers import write_points
from parapoint.files.surfaces import write_obj
from parapoint.surfaces.sampling import mean_spacing
from parapoint.surfaces.spanning import Transform, opened, spanning_edges
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

ENDINGS = (".obj", ".ply", ".npz")
"""Endings of files that a map can be written to."""


def check_target(path: str) -> None:
    """Check that a map can be written to a file.

    Raises:
        InputError: its ending is none of ENDINGS, or its folder does not exist.
    """
    if Path(path).suffix.lower() not in ENDINGS:
        raise InputError(f"{path}: cannot write this ending; take {', '.join(ENDINGS)}")
    if not Path(path).absolute().parent.is_dir():
        raise InputError(f"{path}: there is no such folder; make it first")


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
