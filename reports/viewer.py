"""What the page's viewer is given: the shape of a model once, and each of its maps.

Every file is a script that hands over one object, since a page that opens from disk may load
scripts and nothing else. Coordinates are quantised to 16 bits of their range, distortion to 8: far
below what a screen shows. No number of a table comes from here.
"""

from __future__ import annotations

import base64
import json
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.parameterization import Parameterization
from parapoint.surface import BoolArray, FloatArray, IntArray, Mesh
from reports.render import Camera

LARGEST = 200_000
"""Most faces of a model that the viewer is given; larger ones have their pictures only."""

LEVELS = 62
"""Distortion is given in this many steps of its scale; the number after them says: not defined."""


def packed(values: npt.NDArray[Any]) -> dict[str, object]:
    """Unsigned integers (n,) or (n, k) as an object: differences along n, by byte, deflated."""
    table = values if values.ndim == 2 else values[:, None]
    steps = np.diff(table, axis=0, prepend=np.zeros_like(table[:1]))  # wraps around
    planes = steps.T.astype(steps.dtype.newbyteorder("<"))[..., None].copy().view(np.uint8)
    content = zlib.compress(np.moveaxis(planes, 2, 0).tobytes())
    return {
        "bytes": values.dtype.itemsize,
        "rows": table.shape[0],
        "columns": table.shape[1],
        "data": base64.b64encode(content).decode(),
    }


def quantised(points: FloatArray) -> dict[str, object]:
    """Points (n, k) in 65,536 steps of the longest side of their box, and where that lies."""
    low = points.min(axis=0)
    side = float(np.ptp(points, axis=0).max()) or 1.0
    steps = np.round((points - low) / side * 65535).astype(np.uint16)
    return {"low": low.tolist(), "side": side, "steps": packed(steps)}


def script(name: str, content: dict[str, object]) -> str:
    """The file `name`, which puts `content` under that name into `received`."""
    return f"received[{json.dumps(name)}]={json.dumps(content, separators=(',', ':'))};\n"


def ordered(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """The mesh with neighbours beside each other in memory, and (F,) the old numbers of its faces.

    Differences of neighbours are small and pack well: a third less than in a scrambled order.
    """
    low, side = mesh.vertices.min(axis=0), float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    steps = ((mesh.vertices - low) / side * 1023).astype(np.int64)
    code = np.zeros(len(steps), dtype=np.int64)  # along Morton's curve
    for bit in range(10):
        for axis in range(3):
            code |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    vertex = np.argsort(code, kind="stable")
    rank = np.empty_like(vertex)
    rank[vertex] = np.arange(len(vertex))
    faces = rank[mesh.faces]
    face = np.lexsort((faces.max(axis=1), faces.min(axis=1)))
    return Mesh(mesh.vertices[vertex], faces[face]), face


def shape(mesh: Mesh, camera: Camera) -> dict[str, object]:
    """A model, and the camera that looks at it first."""
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}
    near, order = ordered(mesh)
    return {
        "vertices": quantised(near.vertices),
        "faces": packed(near.faces.astype(np.uint32)),
        "order": packed(order.astype(np.uint32)),
        "axes": camera.axes.tolist(),
        "centre": camera.centre.tolist(),
        "half": float(camera.half.max()),
        "size": float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))),
    }


def indexed(mesh: Mesh, corners: IntArray, uv: FloatArray) -> tuple[FloatArray, IntArray]:
    """The map (F, 3, 2) with the rows numbered as the vertices: uv (V + n, 2), corners (F, 3).

    Row v is the first uv of vertex v; its others follow after V. What is not cut has the faces of
    the mesh for its corners, and needs no list of them.
    """
    count = int(corners.max()) + 1
    pairs, place, of = np.unique(
        mesh.faces.reshape(-1) * count + corners.reshape(-1), return_index=True, return_inverse=True
    )
    vertex = pairs // count
    first = np.diff(vertex, prepend=-1) > 0
    number = np.where(first, vertex, len(mesh.vertices) + np.cumsum(~first) - 1)
    flat = uv.reshape(-1, 2)
    rows = np.tile(flat[:1], (len(mesh.vertices) + int((~first).sum()), 1))
    rows[number] = flat[place]
    return rows, number[of].reshape(-1, 3)


def uv_map(
    mesh: Mesh,
    parameterization: Parameterization,
    uv: FloatArray,
    *,
    distortion: dict[str, tuple[FloatArray, float, float]],
    spanning: BoolArray,
    flipped: BoolArray,
) -> dict[str, object]:
    """A map as it is drawn.

    Args:
        mesh: the surface.
        parameterization: its map.
        uv: (F, 3, 2) the uv of the corners as drawn.
        distortion: by name (F,) values, NaN where not defined, and the ends of their scale.
        spanning: (F,) faces that span a learned seam.
        flipped: (F,) faces turned over.
    """
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}
    mesh, order = ordered(mesh)
    rows, corners = indexed(mesh, parameterization.corners[order], uv[order])
    drawn = Parameterization(rows, corners)
    border = drawn.edge_face_count[drawn.edge_of_halfedge] == 1
    outer = mesh.edge_face_count[mesh.edge_of_halfedge] == 1
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    moved = np.flatnonzero(corners.reshape(-1) != mesh.faces.reshape(-1))
    return {
        "uv": quantised(rows),
        "moved": packed(np.stack([moved, corners.reshape(-1)[moved]], axis=1).astype(np.uint32)),
        "border": packed(ends[border & outer].astype(np.uint32)),
        "seams": packed(ends[border & ~outer].astype(np.uint32)),
        "state": packed((spanning + 2 * flipped).astype(np.uint8)[order]),
        **{name: packed(levels(*scale)[order]) for name, scale in distortion.items()},
    }


def levels(values: FloatArray, low: float, high: float) -> npt.NDArray[np.uint8]:
    """(F,) `values` in LEVELS steps from `low` to `high`; LEVELS + 1 for NaN."""
    known = ~np.isnan(values)
    place = np.clip((np.where(known, values, low) - low) / (high - low), 0, 1)
    return np.where(known, np.round(place * LEVELS), LEVELS + 1).astype(np.uint8)
