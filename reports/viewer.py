"""What the page's viewer is given: the shape of a model once, and each of its maps.

Every file is a script that hands over one object, since a page that opens from disk may load
scripts and nothing else. Positions are given in 16 bits of their range, uv in 14, each as the
difference from what the parallelogram with a neighbouring face predicts (Touma and Gotsman 1998);
distortion in 31 levels. That is below what a screen shows, and a fifth of the bytes of the plain
numbers. No number of a table comes from here.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph

from parapoint.parameterization import Parameterization
from parapoint.surface import BoolArray, FloatArray, IntArray, Mesh, edge_table
from reports.render import Camera, Floats

Script = tuple[Mapping[str, object], Mapping[str, npt.NDArray[Any]]]
"""Facts and arrays of a `script`."""

LARGEST = 200_000
"""Most faces of a model that the viewer is given; larger ones have their pictures only."""

LEVELS = 30
"""Distortion is given in this many steps of its scale; the number after them says: not defined."""

POSITION_BITS, UV_BITS, SKY_BITS = 16, 14, 8
"""Of a coordinate in space, of one in the plane, and of the light that reaches a vertex."""


def script(name: str, facts: Mapping[str, object], arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """The file `name`, which puts an object under that name into `received`.

    Its entries: `facts`; `arrays`, the bytes of an item, rows and columns of each of `arrays`
    (unsigned integers, (n,) or (n, k)); `data`, all of them as `sevens` of a deflated stream:
    array by array, byte by byte of the items, column by column.
    """
    sizes: dict[str, object] = {}
    planes = []
    for key, values in arrays.items():
        table = values if values.ndim == 2 else values[:, None]
        sizes[key] = [values.dtype.itemsize, *table.shape]
        items = table.T.astype(values.dtype.newbyteorder("<"))[..., None].copy().view(np.uint8)
        planes.append(np.moveaxis(items, 2, 0).tobytes())
    head = json.dumps({**facts, "arrays": sizes}, separators=(",", ":"))
    data = sevens(zlib.compress(b"".join(planes), 9))
    return f'received[{json.dumps(name)}]={head[:-1]},"data":"{data}"}};\n'


def sevens(content: bytes) -> str:
    """`content` as the inside of a string of JavaScript: seven bits a letter, all of them ASCII.

    A ninth shorter than base64.
    """
    bits = np.unpackbits(np.frombuffer(content, dtype=np.uint8))
    letters = np.packbits(np.pad(bits, (0, -len(bits) % 7)).reshape(-1, 7), axis=1) >> 1
    return letters.tobytes().decode("ascii").translate(_ESCAPED)


_ESCAPED = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r"})
"""The letters that may not stand in such a string as they are."""


def steps(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Differences along the rows of unsigned integers, from 0; they wrap around."""
    return np.diff(values, axis=0, prepend=np.zeros_like(values[:1]))


def growth(corners: IntArray) -> tuple[IntArray, IntArray]:
    """The rows (n,) of `corners` (F, 3) as they first appear, and (3, n) what predicts each.

    The fourth corner of a parallelogram, one + two - three, over the edge that the row's face
    shares with the first one that has it; where there is none, the row before (-1 for the first).
    """
    row, first = np.unique(corners, return_index=True)
    order = np.argsort(first)
    row, (face, corner) = row[order], np.divmod(first[order], 3)
    edge = edge_table(corners)[1]
    lowest = np.unique(edge, return_index=True)[1]  # the first halfedge of each edge
    one, two = (corners[face, (corner + k) % 3] for k in (1, 2))
    other, across = np.divmod(lowest[edge[3 * face + (corner + 1) % 3]], 3)
    three = corners[other, (across + 2) % 3]
    before = np.concatenate([[-1], row[:-1]])
    return row, np.where(other < face, (one, two, three), before)


def surprises(places: IntArray, corners: IntArray, bits: int) -> npt.NDArray[Any]:
    """By how much the places (n, k), of so many bits, are not what `growth` predicts.

    (m, k) for the rows that `corners` has, as they first appear; in zigzag: 0, -1, 1, -2, 2, ...
    """
    row, (one, two, three) = growth(corners)
    padded = np.concatenate([places, np.zeros_like(places[:1])])  # row -1
    half = 2 ** (bits - 1)
    wrong = padded[row] - padded[one] - padded[two] + padded[three]
    wrong = (wrong + half) % (2 * half) - half
    return np.asarray(np.where(wrong < 0, -2 * wrong - 1, 2 * wrong), dtype=np.uint16)


def quantised(points: FloatArray, bits: int) -> tuple[dict[str, object], IntArray]:
    """Where the box of points (n, k) lies, and their places in steps of its longest side."""
    low = points.min(axis=0)
    side = float(np.ptp(points, axis=0).max()) or 1.0
    places = np.round((points - low) / side * (2**bits - 1)).astype(np.int64)
    return {"low": low.tolist(), "side": side, "bits": bits}, places


def ordered(mesh: Mesh) -> tuple[Mesh, IntArray, IntArray]:
    """The mesh with its faces along a walk over their edges, its vertices as these meet them.

    And the old numbers, (F,) of the faces and (V,) of the vertices; a vertex without a face goes.
    """
    count = len(mesh.faces)
    halfedge = np.argsort(mesh.edge_of_halfedge, kind="stable")
    joined = np.flatnonzero(np.diff(mesh.edge_of_halfedge[halfedge]) == 0)
    one, two = halfedge[joined] // 3, halfedge[joined + 1] // 3

    def graph(one: IntArray, two: IntArray, size: int) -> sparse.coo_matrix:
        return sparse.coo_matrix((np.ones(len(one)), (one, two)), shape=(size, size))

    component = csgraph.connected_components(graph(one, two, count), directed=False)[1]
    firsts = np.unique(component, return_index=True)[1]
    # A root that is joined to every component: one walk meets them all.
    one, two = np.append(one, np.full(len(firsts), count)), np.append(two, firsts)
    walk = csgraph.depth_first_order(
        graph(one, two, count + 1), count, directed=False, return_predecessors=False
    )
    face = walk[1:].astype(np.int64)
    old, first, number = np.unique(mesh.faces[face], return_index=True, return_inverse=True)
    met = np.argsort(first)
    rank = np.empty_like(met)
    rank[met] = np.arange(len(met))
    return Mesh(mesh.vertices[old[met]], rank[number].reshape(-1, 3)), face, old[met]


def shape(mesh: Mesh, camera: Camera, sky: Floats) -> Script:
    """Facts and arrays of a model: itself, the camera that looks at it first, and its `sky`.

    That is (V, 2): how much light of the sky reaches the front and the back of a vertex, 0 to 1.
    """
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}, {}
    near, face, vertex = ordered(mesh)
    box, places = quantised(near.vertices, POSITION_BITS)
    facts = {
        "box": box,
        "axes": camera.axes.tolist(),
        "centre": camera.centre.tolist(),
        "half": float(camera.half.max()),
        "size": float(np.linalg.norm(np.ptp(mesh.vertices, axis=0))),
    }
    flat = near.faces.reshape(-1)
    highest = np.maximum.accumulate(flat)
    below = np.concatenate([[0], highest[:-1] + 1]) - flat  # 0 for a vertex that is new
    light = np.round((2**SKY_BITS - 1) * sky[vertex]).astype(np.int64)
    return facts, {
        "faces": below.astype(np.uint32).reshape(-1, 3),
        "order": steps(face.astype(np.uint32)),
        "vertices": surprises(places, near.faces, POSITION_BITS),
        "sky": surprises(light, near.faces, SKY_BITS),
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
) -> Script:
    """A map as it is drawn: facts and arrays of its `script`.

    Args:
        mesh: the surface.
        parameterization: its map.
        uv: (F, 3, 2) the uv of the corners as drawn.
        distortion: by name (F,) values, NaN where not defined, and the ends of their scale.
        spanning: (F,) faces that span a learned seam.
        flipped: (F,) faces turned over.
    """
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}, {}
    mesh, order, _ = ordered(mesh)
    rows, corners = indexed(mesh, parameterization.corners[order], uv[order])
    drawn = Parameterization(rows, corners)
    border = drawn.edge_face_count[drawn.edge_of_halfedge] == 1
    outer = mesh.edge_face_count[mesh.edge_of_halfedge] == 1
    ends = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
    moved = np.flatnonzero(corners.reshape(-1) != mesh.faces.reshape(-1))
    lists = {
        "moved": np.stack([moved, corners.reshape(-1)[moved]], axis=1),
        "border": ends[border & outer],
        "seams": ends[border & ~outer],
    }
    box, places = quantised(rows, UV_BITS)
    return {"box": box}, {
        "uv": surprises(places, corners, UV_BITS),
        "state": (spanning + 2 * flipped).astype(np.uint8)[order],
        **{name: steps(values.astype(np.uint32)) for name, values in lists.items()},
        **{name: steps(levels(*scale)[order]) for name, scale in distortion.items()},
    }


def levels(values: FloatArray, low: float, high: float) -> npt.NDArray[np.uint8]:
    """(F,) `values` in LEVELS steps from `low` to `high`; LEVELS + 1 for NaN."""
    known = ~np.isnan(values)
    place = np.clip((np.where(known, values, low) - low) / (high - low), 0, 1)
    return np.where(known, np.round(place * LEVELS), LEVELS + 1).astype(np.uint8)
