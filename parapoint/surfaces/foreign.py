"""Surfaces as other libraries hold them: meshes of trimesh, clouds of Open3D, tensors of torch."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse

from parapoint.errors import InputError
from parapoint.surfaces.normals import known_or_zero
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

logger = logging.getLogger("parapoint")


def surface_or_array(given: Any) -> Surface | npt.NDArray[Any]:
    """What any library holds as a surface, as ours; what is an array of any kind, as NumPy's.

    Known by what they offer: `vertices` with `faces` (trimesh) or `triangles` (Open3D) make a mesh,
    `vertices` or `points` alone a cloud, with `colors` and `normals` where there is one a point;
    points that are not finite are dropped.
    A tensor may lie on any device and belong to a graph.

    Raises:
        InputError: the vertices or faces are not as those of a mesh have to be; an array is sparse
            or complex.
    """
    if isinstance(given, Mesh | PointCloud):
        return given
    if hasattr(given, "detach"):
        return np.asarray(given.detach().cpu())
    points = getattr(given, "vertices", getattr(given, "points", None))
    if points is None:
        return _dense(given)
    faces = getattr(given, "faces", getattr(given, "triangles", None))
    if faces is not None and len(faces):
        return Mesh(np.asarray(points), np.asarray(faces))
    at = np.asarray(points)
    normals = np.asarray(getattr(given, "normals", ()))
    colours = np.asarray(getattr(given, "colors", ()))
    finite = np.isfinite(at).all(axis=1) if at.ndim == 2 and at.dtype.kind == "f" else None
    if finite is None or not len(at) or not finite.any():
        return PointCloud(at)  # which says what is wrong with it
    if dropped := int((~finite).sum()):
        logger.warning("dropped %d of %d points: not finite", dropped, len(at))
    known = None
    if len(normals) == len(at):
        known = known_or_zero(normals)[finite]
    attributes = {}
    if len(colours) == len(at):
        if colours.dtype.kind == "f":  # single precision rounds 1 to a little more
            colours = np.where((colours > 1) & (colours < 1 + 1e-5), 1.0, colours)
        attributes["colours"] = colours[finite, :3]
    rows = np.flatnonzero(finite) if dropped else None
    return PointCloud(at[finite], known, dropped, attributes, rows)


def _dense(given: Any) -> npt.NDArray[Any]:
    if sparse.issparse(given):
        raise InputError("sparse input is not supported; take a dense array of coordinates")
    try:
        array = np.asarray(given)
    except ValueError as error:  # rows of different lengths
        raise InputError(f"points must be numbers: {error}") from None
    if np.iscomplexobj(array):
        raise InputError("Complex data not supported: coordinates are real numbers")
    return array
