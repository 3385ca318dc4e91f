"""What the page's viewer is given: the shape of a model once, and each of its maps.

Every file is a script that hands over one object, since a page that opens from disk may load
scripts and nothing else. Positions are given in 16 bits of their range, as the difference from what
the parallelogram with a neighbouring face predicts (Touma and Gotsman 1998); uv in 14, as that from
where the neighbour's affine map takes the unfolded face (in the manner of Isenburg and Snoeyink
2003); distortion in 31 levels, as that from what such positions and uv give. That is below what a
screen shows, and a tenth of the bytes of the plain numbers. No number of a table comes from here.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypedDict

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse import csgraph

from benchmarks.rendering.camera import Camera
from benchmarks.rendering.colours import Floats
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh, edge_table

Script = tuple[Mapping[str, object], Mapping[str, npt.NDArray[Any]]]
"""Facts and arrays of a `script`."""

LARGEST = 200_000
"""Most faces of a model that the viewer is given; larger ones have their pictures only."""

LEFT_OUT = 5
"""State of a face that the map leaves out. It is odd, like that of one that spans a seam: the
distortion of neither is given.
"""

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
"""The letters that have to be escaped in such a string."""


def steps(values: IntArray) -> npt.NDArray[Any]:
    """Differences along the rows, from 0, in `zigzag`."""
    return zigzag(np.diff(values, axis=0, prepend=0)).astype(np.uint32)


def zigzag(values: IntArray) -> IntArray:
    """Integers as natural numbers: 0, -1, 1, -2, 2, ... as 0, 1, 2, 3, 4, ..."""
    return np.where(values < 0, -2 * values - 1, 2 * values)


def growth(corners: IntArray) -> tuple[IntArray, IntArray]:
    """The rows (n,) of `corners` (F, 3) as they first appear, and (3, n) what predicts each.

    The corners of the first face that shares with the row's face the edge across from the row,
    those of the edge first; where there is none, three times the row before (-1 for the first).
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


def surprises(
    places: IntArray, corners: IntArray, bits: int, space: IntArray | None = None
) -> npt.NDArray[Any]:
    """The differences of the places (n, k), of `bits` bits, from what `growth` predicts.

    It predicts the fourth corner of a parallelogram or, for rows that lie at `space` (n, 3), the
    place to which the affine map of the known face takes the new corner, `unfolded`.

    Returns (m, k) differences in `zigzag`, for the rows of `corners` in the order in which they
    first appear.
    """
    row, known = growth(corners)
    shares = [1.0, 1.0, -1.0] if space is None else unfolded(_padded(space), row, *known)
    (one, two, three), (a, b, c) = _padded(places)[known], (np.reshape(s, (-1, 1)) for s in shares)
    guess = np.floor(a * one + b * two + c * three + 0.5).astype(np.int64)
    half = 2 ** (bits - 1)
    wrong = (places[row] - guess + half) % (2 * half) - half
    return zigzag(wrong).astype(np.uint16)


def _padded(places: IntArray) -> IntArray:
    """`places` (n, k) with a row -1 of zeros."""
    return np.concatenate([places, np.zeros_like(places[:1])])


STEEPEST = 4.0
"""A face is not unfolded over a neighbour of less than a fourth of its height."""


def unfolded(
    space: IntArray, row: IntArray, one: IntArray, two: IntArray, three: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n,) shares of `one`, `two` and `three` in `row`, turned into their plane about one - two.

    Those of a parallelogram where that cannot be done. The viewer does the same, operation by
    operation: what either rounds differently would add up.
    """
    edge = space[two] - space[one]
    square = _dot(edge, edge)
    safe = np.where(square > 0, square, 1)

    def from_edge(of: IntArray) -> tuple[FloatArray, FloatArray]:
        """How far along the edge, and how high over it."""
        apart = space[of] - space[one]
        along = _dot(apart, edge) / safe
        off = apart - along[:, None] * edge
        return along, np.sqrt(_dot(off, off))

    (along, height), (known, least) = from_edge(row), from_edge(three)
    sound = (square > 0) & (height <= STEEPEST * least) & (least > 0)
    third = -height / np.where(sound, least, 1)
    second = along - third * known
    shares = (1 - second - third, second, third)
    first, second, third = (np.where(sound, s, o) for s, o in zip(shares, (1, 1, -1), strict=True))
    return first, second, third


def _dot(one: npt.NDArray[Any], two: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """(n,) of (n, k), summed in the order of the columns."""
    total = one[:, 0] * two[:, 0]
    for k in range(1, one.shape[1]):
        total = total + one[:, k] * two[:, k]
    return np.asarray(total)


class Box(TypedDict):
    """Where quantised points lie: lowest corner, longest side, bits of a coordinate."""

    low: list[float]
    side: float
    bits: int


def quantised(points: FloatArray, bits: int) -> tuple[Box, IntArray]:
    """Where the box of points (n, k) lies, and their places in steps of its longest side."""
    low = points.min(axis=0)
    side = float(np.ptp(points, axis=0).max()) or 1.0
    places = np.round((points - low) / side * (2**bits - 1)).astype(np.int64)
    return {"low": low.tolist(), "side": side, "bits": bits}, places


@lru_cache(maxsize=1)  # of one model there are many maps
def ordered(mesh: Mesh) -> tuple[Mesh, IntArray, IntArray]:
    """The mesh with its faces along a walk over their edges, its vertices as these meet them.

    A face that shares an edge with the one before begins with it. And the old numbers: (F, 3) of
    the corners, counted through the faces, and (V,) of the vertices; one without a face goes.
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
    faces = mesh.faces[walk[1:]]
    shared = _among(faces, np.roll(faces, 1, axis=0)) < 3
    turn = np.where(shared.sum(axis=1) == 2, shared.argmin(axis=1) + 1, 0)
    corner = 3 * walk[1:, None].astype(np.int64) + (np.arange(3) + turn[:, None]) % 3
    flat = mesh.faces.reshape(-1)[corner]
    old, first, number = np.unique(flat, return_index=True, return_inverse=True)
    met = np.argsort(first)
    rank = np.empty_like(met)
    rank[met] = np.arange(len(met))
    return Mesh(mesh.vertices[old[met]], rank[number].reshape(-1, 3)), corner, old[met]


def _among(faces: IntArray, others: IntArray) -> IntArray:
    """(F, 3) which corner of the face in `others` (F, 3) each corner of `faces` is; 3 for none."""
    same = faces[:, :, None] == others[:, None, :]
    return np.where(same.any(axis=2), same.argmax(axis=2), 3)


def shape(mesh: Mesh, camera: Camera, sky: Floats) -> Script:
    """Facts and arrays of a model: itself, the camera that looks at it first, and its `sky`.

    That is (V, 2): how much light of the sky reaches the front and the back of a vertex, 0 to 1.
    """
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}, {}
    near, corner, vertex = ordered(mesh)
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
    before = np.concatenate([[[-1, -1, -1]], near.faces[:-1]])
    place = _among(near.faces, before)
    place[:, 2] = 3
    light = np.round((2**SKY_BITS - 1) * sky[vertex]).astype(np.int64)
    return facts, {
        "places": (place[:, 0] + 4 * place[:, 1]).astype(np.uint8),
        "faces": below[place.reshape(-1) == 3].astype(np.uint32),
        "order": steps(corner[:, 0] // 3),
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
    covered: BoolArray,
) -> Script:
    """A map as it is drawn: facts and arrays of its `script`.

    Args:
        mesh: the surface.
        parameterization: its map.
        uv: (F, 3, 2) the uv of the corners as drawn.
        distortion: by name (F,) values, NaN where not defined, and the ends of their scale.
        spanning: (F,) faces that span a learned seam.
        flipped: (F,) faces turned over.
        covered: (F,) faces that the map does not leave out; no other shares a row of uv with them.
    """
    if len(mesh.faces) > LARGEST:
        return {"large": len(mesh.faces)}, {}
    mesh, corner, _ = ordered(mesh)
    order = corner[:, 0] // 3
    own = np.where(covered[:, None], parameterization.corners, len(parameterization.uv))
    at = own.reshape(-1)[corner]
    rows, corners = indexed(mesh, at, uv.reshape(-1, 2)[corner])
    moved = np.flatnonzero(corners.reshape(-1) != mesh.faces.reshape(-1))
    vertex = np.arange(len(rows))
    vertex[corners] = mesh.faces
    of_shape, space = quantised(mesh.vertices, POSITION_BITS)
    box, places = quantised(rows, UV_BITS)
    state = np.where(covered, spanning + 2 * flipped, LEFT_OUT).astype(np.uint8)
    guess = rough(space[mesh.faces], places[corners], _step(box) / _step(of_shape))
    guess = {name: np.where(state[order] % 2, np.nan, values) for name, values in guess.items()}
    return {"box": box}, {
        "uv": surprises(places, corners, UV_BITS, space[vertex]),
        "state": state[order],
        "moved": steps(np.stack([moved, corners.reshape(-1)[moved]], axis=1)),
        **{
            name: levels(values[order], low, high) - levels(guess[name], low, high)
            for name, (values, low, high) in distortion.items()
        },
    }


def _step(box: Box) -> float:
    """The length of a step of `quantised`."""
    return box["side"] / float(2 ** box["bits"] - 1)


def rough(space: IntArray, places: IntArray, scale: float) -> dict[str, FloatArray]:
    """Distortion of the faces whose corners lie at `space` (F, 3, 3) and at `places` (F, 3, 2).

    By name (F,): "angle", log2(sigma1 / sigma2), and "area", log2(UV area / 3D area), for steps in
    the plane that are `scale` times as long as those in space; NaN for a face without area.
    """
    (a, b), (p, q) = ([of[:, k] - of[:, 0] for k in (1, 2)] for of in (space, places))
    aa, ab, bb = (_dot(*pair).astype(np.float64) for pair in ((a, a), (a, b), (b, b)))
    area = np.sqrt(np.maximum(aa * bb - ab * ab, 0))
    flat = np.abs(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        half = (bb * _dot(p, p) - 2 * ab * _dot(p, q) + aa * _dot(q, q)) / (area * flat) / 2
        ratio = half + np.sqrt(np.maximum(half * half - 1, 0))
        found = {"angle": np.log2(ratio), "area": np.log2(flat / area * scale**2)}
    return {name: np.where(area > 0, values, np.nan) for name, values in found.items()}


def levels(values: FloatArray, low: float, high: float) -> npt.NDArray[np.uint8]:
    """(F,) `values` in LEVELS steps from `low` to `high`; LEVELS + 1 for NaN."""
    known = ~np.isnan(values)
    place = np.clip((np.where(known, values, low) - low) / (high - low), 0, 1)
    return np.where(known, np.round(place * LEVELS), LEVELS + 1).astype(np.uint8)
