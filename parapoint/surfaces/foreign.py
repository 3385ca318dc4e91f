"""Surfaces as other libraries hold them: meshes of trimesh, clouds of Open3D, tensors of torch."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse

from parapoint.errors import InputError
from parapoint.surfaces.surface import Mesh, PointCloud, Surface


def surface_or_array(given: Any) -> Surface | npt.NDArray[Any]:
    """What any library holds as a surface, as ours; what is an array of any kind, as NumPy's.

    Known by what they offer: `vertices` with `faces` (trimesh) or `triangles` (Open3D) make a mesh,
    `vertices` or `points` alone a cloud, with `colors` and `normals` where there is one a point.
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
    attributes = {"colours": colours[:, :3]} if len(colours) == len(at) else {}
    return PointCloud(at, normals if len(normals) == len(at) else None, attributes=attributes)


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
