"""NumPy archives as we write them: bytes in, `Content` out."""

from __future__ import annotations

import io
import logging

import numpy as np

from parapoint.errors import InputError
from parapoint.files.attributes import named_colours
from parapoint.files.content import Content, points_content
from parapoint.files.decoding import opened_archive

OF_MESHES = {"vertices", "faces", "uv", "corners", "colours", "colors"}
"""Arrays of a mesh that are read."""

logger = logging.getLogger("parapoint")


def npz(data: bytes) -> Content:
    """Arrays points, normals and whatever else is known; or vertices, faces, uv and corners.

    "colors" are "colours", of any type: open3d and trimesh call them so.
    """
    if not data:
        raise InputError("is empty")
    with opened_archive(io.BytesIO(data)) as file:
        arrays = {name: np.asarray(file[name]) for name in file.files}
    if "vertices" in arrays and "faces" in arrays:
        faces = _whole(arrays, "faces")
        content = Content(
            _coordinates(arrays, "vertices"), np.full(len(faces), 3), faces.reshape(-1)
        )
        if "uv" in arrays:
            uv_corners = _whole(arrays, "corners" if "corners" in arrays else "faces")
            content.uv, content.uv_corners = arrays["uv"], uv_corners.reshape(-1)
        given = arrays.get("colours", arrays.get("colors"))
        content.attributes = _colours(given, len(content.vertices))
        content.extras = tuple(name for name in arrays if name not in OF_MESHES)
        return content
    if "points" not in arrays:
        raise InputError("has no array 'points'; a point map has points and uv")
    points = _coordinates(arrays, "points")
    normals = arrays.pop("normals", None)
    others = {name: of for name, of in arrays.items() if len(np.atleast_1d(of)) == len(points)}
    if "uv" in arrays and "uv" not in others:
        raise InputError(f"has {len(np.atleast_1d(arrays['uv']))} uv rows for {len(points)} points")
    del others["points"]
    name = "colours" if "colours" in others else "colors"
    if name in others and (colours := _colours(others[name], len(points))):
        del others[name]
        others |= colours
    for name, of in list(others.items()):
        if of.dtype.kind not in "biuf" or of.ndim > 2:
            logger.warning("the array %r left out: it has no numbers of shape (n,) or (n, k)", name)
            del others[name]
    return points_content(points, normals, others)


def _colours(given: np.ndarray | None, count: int) -> dict[str, np.ndarray]:
    """The attribute "colours" of `count` points, {} where the array holds none."""
    if (
        given is None
        or given.shape not in {(count, 3), (count, 4)}
        or given.dtype.kind not in "fiu"
    ):
        return {}
    colours = named_colours(given)
    return {} if colours is None else {"colours": colours}


def _coordinates(arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    """(n, 3) numbers of an array."""
    array = arrays[name]
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu":
        raise InputError(f"{name} must have shape (n, 3), not {array.shape} {array.dtype}")
    return array.astype(np.float64)


def _whole(arrays: dict[str, np.ndarray], name: str) -> np.ndarray:
    """(n, 3) indices of an array."""
    array = arrays[name]
    if array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "iu":
        raise InputError(f"{name} must be whole numbers of shape (n, 3), not {array.shape}")
    return array.astype(np.int64)
