"""What the atlas makers share: from a library's output to a map of the mesh that went in."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh


def atlas(
    mesh: Mesh,
    *,
    source: npt.ArrayLike,
    corners: npt.ArrayLike,
    uv: npt.ArrayLike,
    page_size: tuple[float, float],
    page: npt.ArrayLike,
) -> Parameterization:
    """The map in texels, pages side by side.

    Both libraries divide u by the width and v by the height of a page that need not be square;
    taken as it is, that would stretch every chart.

    Args:
        mesh: what went in.
        source: (T,) vertex of the mesh for each row of `uv`.
        corners: (F, 3) rows of `uv`, faces in the order of the mesh.
        uv: (T, 2) coordinates in [0, 1] on their page.
        page_size: width and height of a page in texels.
        page: (T,) page of each row; rows that are on none (of faces without area) lie at zero.

    Raises:
        FlatteningError: faces or corners are not those of the mesh, or uv is not finite.
    """
    source, uv = np.asarray(source, dtype=np.int64), np.array(uv, dtype=np.float64)
    corners, page = np.asarray(corners, dtype=np.int64), np.asarray(page, dtype=np.int64)
    if corners.shape != mesh.faces.shape or not np.array_equal(source[corners], mesh.faces):
        raise FlatteningError(
            f"the atlas has {len(corners)} faces that are not the mesh's {len(mesh.faces)} in order"
        )
    if not np.isfinite(uv).all():
        raise FlatteningError("the atlas has coordinates that are not finite")
    placed = (page >= 0) & (page < np.iinfo(np.uint32).max)
    uv *= page_size
    uv[placed, 0] += page[placed] * float(page_size[0])
    report: dict[str, object] = {"unplaced_faces": int((~placed[corners]).any(axis=1).sum())}
    return Parameterization(uv, corners, report=report)


def joined_corners(mesh: Mesh, uv: FloatArray) -> Parameterization:
    """The map with one row for all corners that have the same vertex and the same uv (F, 3, 2).

    Raises:
        FlatteningError: uv is not finite.
    """
    if not np.isfinite(uv).all():
        raise FlatteningError("the atlas has coordinates that are not finite")
    rows = uv.reshape(-1, 2)
    corners = row_numbers(mesh.faces.reshape(-1), rows @ [1, 1j])
    return Parameterization(rows[first_rows(corners)], corners.reshape(-1, 3))


def row_numbers(*columns: npt.NDArray[Any]) -> IntArray:
    """(N,) a number for each distinct row of some columns (N,), 0, 1, ... as they first appear.

    By one sort of all columns, which takes a fraction of the time of `np.unique(axis=0)`.
    """
    order = np.lexsort(columns)  # stable: of equal rows the first one comes first
    begins = np.ones(len(order), dtype=bool)
    begins[1:] = np.logical_or.reduce([np.diff(column[order]) != 0 for column in columns])
    first = order[begins]
    number = np.empty(len(first), dtype=np.int64)
    number[np.argsort(first)] = np.arange(len(first))
    numbers = np.empty(len(order), dtype=np.int64)
    numbers[order] = number[np.cumsum(begins) - 1]
    return numbers


def first_rows(number: IntArray) -> IntArray:
    """(n,) the first row that has each of the numbers 0, 1, ..., n - 1; (N,) given."""
    first = np.empty(int(number.max()) + 1, dtype=np.int64)
    first[number[::-1]] = np.arange(len(number))[::-1]
    return first
