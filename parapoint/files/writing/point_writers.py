"""Writers of point clouds with their UV: PLY, NumPy's NPZ, and OBJ without faces."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import COLOUR_COLUMNS, unit_colours
from parapoint.files.targets import complete_file
from parapoint.surfaces.parameterization import PointParameterization
from parapoint.surfaces.surface import FloatArray, PointCloud

logger = logging.getLogger("parapoint")

ROWS_WRITTEN = 65_536
"""Points written at a time, which bounds the memory that their text takes beside them."""
PLY_NAMES = {
    "i1": "char",
    "u1": "uchar",
    "i2": "short",
    "u2": "ushort",
    "i4": "int",
    "u4": "uint",
    "f4": "float",
    "f8": "double",
}


def write_points(path: str | Path, cloud: PointCloud, uv: FloatArray) -> None:
    """Write points and their UV: .ply (properties u and v), .npz (points, uv) or .obj (v, vt).

    Normals and attributes are carried where the cloud has them; OBJ has room for colours alone,
    as fractions behind each position. Where rows of the file were left out, `file_row` says which
    row, from 0, each point was.

    Raises:
        InputError: another ending; `uv` is not (P, 2), each row finite or of two NaN.
        OSError: the file cannot be written; nothing is left behind.
    """
    path = Path(path)
    if not np.isfinite(uv).all():  # stray points have no place
        uv = PointParameterization(uv).uv
    elif np.ndim(uv) != 2 or uv.shape[1] != 2:
        raise InputError(f"{path}: uv must have shape (n, 2), not {np.shape(uv)}")
    if len(uv) != len(cloud.points):
        raise InputError(f"{path}: {len(uv)} uv for {len(cloud.points)} points")
    writers: dict[str, Callable[[IO[bytes], PointCloud, FloatArray], None]] = {
        ".ply": _ply,
        ".npz": _npz,
        ".obj": _obj,
    }
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"{path}: points are written as {', '.join(writers)}")
    with complete_file(path) as file:
        writer(file, cloud, uv)


def _npz(file: IO[bytes], cloud: PointCloud, uv: FloatArray) -> None:
    """Arrays `points`, `normals`, `uv`, and each attribute by its name."""
    arrays: dict[str, Any] = {**_known(cloud), "points": cloud.points, "uv": uv}
    if cloud.normals is not None:
        arrays["normals"] = cloud.normals
    np.savez_compressed(file, **arrays)


def _known(cloud: PointCloud) -> dict[str, npt.NDArray[Any]]:
    """The attributes of the points, and the rows that they come from where some were left out."""
    rows = {} if cloud.rows is None else {"file_row": cloud.rows.astype(np.uint32)}
    return {**cloud.attributes, **rows}


def ply_columns(cloud: PointCloud) -> dict[str, npt.NDArray[Any]]:
    """The properties (P,) of the points in a PLY file, by name, in order."""
    columns = dict(zip("xyz", cloud.points.T, strict=True))
    if cloud.normals is not None:
        columns |= dict(zip(("nx", "ny", "nz"), cloud.normals.T, strict=True))
    for name, values in _known(cloud).items():
        if name == "colours":
            columns |= dict(zip(COLOUR_COLUMNS[0], values.T, strict=False))
        elif values.ndim == 1:
            columns["_".join(name.split())] = values
        else:
            columns |= {f"{'_'.join(name.split())}_{k}": of for k, of in enumerate(values.T)}
    return columns


def _ply(file: IO[bytes], cloud: PointCloud, uv: FloatArray) -> None:
    """Little-endian PLY; attributes keep their types where PLY has them."""
    given = ply_columns(cloud) | dict(zip("uv", uv.T, strict=True))
    columns = {
        name: values if values.dtype.str[1:] in PLY_NAMES else values.astype(np.float64)
        for name, values in given.items()
    }
    kind = np.dtype([(name, of.dtype.newbyteorder("<")) for name, of in columns.items()])
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(uv)}",
        *(f"property {PLY_NAMES[of.dtype.str[1:]]} {name}" for name, of in columns.items()),
        "end_header\n",
    ]
    file.write("\n".join(header).encode())
    for rows in _slices(len(uv)):
        part = np.empty(len(uv[rows]), kind)
        for name, values in columns.items():
            part[name] = values[rows]
        file.write(part.tobytes())


def _obj(file: IO[bytes], cloud: PointCloud, uv: FloatArray) -> None:
    """OBJ without faces: row k of v, vn and vt is point k, white where it has no colour."""
    columns = {"v": cloud.points, "vn": cloud.normals, "vt": uv}
    if left := [name for name in _known(cloud) if name != "colours"]:
        logger.warning("OBJ has no room for: %s; a .ply or .npz file keeps them", ", ".join(left))
    colours = cloud.attributes.get("colours")
    if colours is not None:
        columns["v"] = np.concatenate(
            [cloud.points, np.nan_to_num(unit_colours(colours)[:, :3], nan=1.0)], axis=1
        )
    for key, values in columns.items():
        if values is None:
            continue
        for rows in _slices(len(values)):
            lines = (" ".join(map(repr, row)) for row in values[rows].tolist())
            file.write("".join(f"{key} {line}\n" for line in lines).encode())


def _slices(count: int) -> Iterator[slice]:
    """Rows written at a time."""
    return (slice(k, k + ROWS_WRITTEN) for k in range(0, count, ROWS_WRITTEN))
