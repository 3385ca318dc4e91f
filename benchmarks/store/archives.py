"""Arrays in npz files: how surfaces and maps are stored. No file is ever unpickled."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import math
import os
import re
import typing
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.decoding import opened_archive
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

SEAL = "content_sha256"
"""The name under which a sealed npz file carries the hash of its other arrays."""
HASH = re.compile(r"[0-9a-f]{8,64}")
"""What a hash, and so the name of a file in the store, looks like."""
Arrays = Mapping[str, npt.NDArray[Any]]
_DAMAGE = (
    *(OSError, EOFError, ValueError, TypeError, AttributeError, KeyError, MemoryError),
    *(NotImplementedError, zipfile.BadZipFile, zlib.error),
)
"""Errors that reading a damaged archive can raise."""


def arrays_hash(arrays: Arrays) -> str:
    """64 hexadecimal digits over the names, shapes and values of `arrays`."""
    digest = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        digest.update(f"{name} {array.dtype.str} {array.shape} ".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def surface_arrays(surface: Surface) -> dict[str, npt.NDArray[Any]]:
    """The arrays that make up `surface`."""
    if isinstance(surface, Mesh):
        return {"vertices": surface.vertices, "faces": surface.faces}
    arrays = {"points": surface.points}
    if surface.normals is not None:
        arrays["normals"] = surface.normals
    if "colours" in surface.attributes:
        arrays["colours"] = surface.attributes["colours"]
    return arrays


def map_arrays(result: Parameterization | PointParameterization) -> dict[str, npt.NDArray[Any]]:
    """The arrays that make up a map, without its trace."""
    if isinstance(result, Parameterization):
        return {"uv": result.uv, "corners": result.corners}
    return {"uv": result.uv}


def trace_arrays(trace: tuple[TracePoint, ...]) -> dict[str, npt.NDArray[Any]]:
    """A trace as arrays. A value that a point lacks is NaN; the map of point n is `trace_uv_n`."""
    if not trace:
        return {}
    steps, seconds, terms, maps = zip(*trace, strict=True)
    names = list(dict.fromkeys(name for term in terms for name in term))
    values = [[float(term.get(name, math.nan)) for name in names] for term in terms]
    arrays: dict[str, npt.NDArray[Any]] = {
        "trace_iteration": np.array(steps, dtype=np.int64),
        "trace_seconds": np.array(seconds, dtype=np.float64),
        "trace_names": np.array(names, dtype=np.str_),
        "trace_values": np.array(values, dtype=np.float64).reshape(len(trace), len(names)),
    }
    for n, uv in enumerate(maps):
        if uv is not None:
            arrays[f"trace_uv_{n}"] = np.asarray(uv, dtype=np.float64)
    return arrays


def _trace(arrays: Arrays) -> tuple[TracePoint, ...]:
    """The trace that `trace_arrays` wrote."""
    if "trace_iteration" not in arrays:
        return ()
    names = [str(name) for name in arrays["trace_names"]]
    return tuple(
        TracePoint(
            int(iteration),
            float(arrays["trace_seconds"][n]),
            {
                name: float(value)
                for name, value in zip(names, arrays["trace_values"][n], strict=True)
                if not math.isnan(value)
            },
            arrays.get(f"trace_uv_{n}"),
        )
        for n, iteration in enumerate(arrays["trace_iteration"])
    )


def write_arrays(path: Path, arrays: Arrays, *, sealed: bool = False) -> None:
    """Write `arrays` to the npz file `path`: all of it or nothing, and onto the disk.

    Args:
        path: where to.
        arrays: by name; integers have 64 bits.
        sealed: also write their hash, for a file whose name is not its own hash.
    """
    if sealed:
        arrays = {**arrays, SEAL: np.array(arrays_hash(arrays))}
    # Indices take up most of a map. 32 bits hold them, which leaves half the bytes to compress.
    small = {
        name: array.astype(np.int32)
        if array.dtype == np.int64 and array.size and abs(array).max() < 2**31
        else array
        for name, array in arrays.items()
    }
    with replacing(path) as stream:
        np.savez_compressed(stream, allow_pickle=False, **small)


def read_arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The arrays of the npz file `path`; nothing in it is unpickled.

    Raises:
        InputError: the file is missing or damaged, decodes to more than it may, or has a seal that
            does not fit.
    """
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: damaged (no file, but a folder, a pipe or a device)")
    try:
        with path.open("rb") as stream, opened_archive(stream) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except FileNotFoundError:
        raise InputError(f"{path}: missing") from None
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except _DAMAGE as error:
        raise InputError(f"{path}: damaged ({error})") from None
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise InputError(f"{path}: damaged (it holds what is no array)")
    found = {
        name: array.astype(np.int64) if array.dtype == np.int32 else array
        for name, array in arrays.items()
    }
    seal = found.pop(SEAL, None)
    if seal is not None and str(seal) != arrays_hash(found):
        raise InputError(f"{path}: damaged (its content does not fit its hash)")
    return found


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[typing.IO[bytes]]:
    """A stream whose content becomes the file `path` in one step, if the block raises nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Put the names of the files in `folder` onto the disk, if the system can do so."""
    with contextlib.suppress(OSError, AttributeError):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextlib.contextmanager
def disk_said(path: Path) -> Iterator[None]:
    """Turn a full disk, or a limit on the size of files, into one clear line.

    Raises:
        InputError: the disk is full, or the limit is reached.
    """
    try:
        yield
    except OSError as error:
        if error.errno in {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}:
            raise InputError(
                f"{path}: {os.strerror(error.errno).lower()}; earlier results are intact: make "
                "room and run the same command again"
            ) from None
        raise


def read_surface(path: Path) -> Surface:
    """The surface in a file of the store.

    Raises:
        InputError: the file is missing or damaged.
    """
    arrays = read_arrays(path)
    try:
        if "faces" in arrays:
            return Mesh(arrays["vertices"], arrays["faces"])
        attributes = {name: arrays[name] for name in ("colours",) if name in arrays}
        return PointCloud(arrays["points"], arrays.get("normals"), attributes=attributes)
    except (InputError, KeyError) as error:
        raise InputError(f"{path}: damaged ({error})") from None


def read_map(
    path: Path, report: Mapping[str, object] | None = None
) -> Parameterization | PointParameterization:
    """The map in a file of the store, with its trace.

    Raises:
        InputError: the file is missing or damaged.
    """
    arrays = read_arrays(path)
    try:
        trace = _trace(arrays)
        if "corners" in arrays:
            return Parameterization(arrays["uv"], arrays["corners"], trace, report or {})
        return PointParameterization(arrays["uv"], trace, report or {})
    except (InputError, KeyError, IndexError, ValueError, TypeError) as error:
        raise InputError(f"{path}: damaged ({error})") from None
