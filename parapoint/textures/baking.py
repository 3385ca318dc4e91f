"""Baking: what is known at the points of a cloud, painted into the texture of a mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import igl
import numpy as np
import numpy.typing as npt
from scipy import ndimage
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.files.attributes import unit_colours
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import FloatArray, Mesh, PointCloud, Surface
from parapoint.textures.known import check_bakeable, facing_outwards, knowing
from parapoint.textures.scattered import Scattered
from parapoint.textures.tangents import in_tangent_space
from parapoint.textures.texels import Texels, texels

SMALLEST, LARGEST = 16, 8192
"""Texels along a side of a texture."""
MARGIN = 16
"""Texels around each chart that repeat its edge, so that a viewer's filter reads no others."""
BATCH = 262_144
"""Texels that are painted at a time, which bounds the memory to some 100 MB."""

APART = 0.05
"""Distance from a mesh, in diagonals of the mesh, beyond which a point does not lie on it."""
COMPARED = 1000
"""Points whose distance is looked at: of a larger cloud at least so many, and fewer than twice."""

Pixels = npt.NDArray[np.uint8 | np.uint16]


class Baked(NamedTuple):
    """A texture.

    Attributes:
        pixels: (N, N, c) uint8 or uint16, first row at the top.
        text: what has to be known to read it, for the PNG file.
        fill: share of the texels that lie on the surface.
    """

    pixels: Pixels
    text: dict[str, str]
    fill: float


def check_size(size: int, margin: int) -> None:
    """Check the size of a texture and its margin, in texels.

    Raises:
        InputError: one is out of range.
    """
    for name, value, least, most in (
        ("--texture", size, SMALLEST, LARGEST),
        ("--margin", margin, 0, size // 4),
    ):
        if not least <= value <= most:
            raise InputError(f"{name} must be from {least} to {most} texels, not {value}")


def check_in_square(charted: Charted) -> None:
    """Check that a map lies in the unit square, and shows some face with an area there.

    Raises:
        InputError: it does not.
    """
    used = charted.map.uv[np.unique(charted.map.corners)]
    if used.min() < -1e-6 or used.max() > 1 + 1e-6:
        raise InputError("its UVs leave the unit square, so one texture cannot hold them")
    in_plane = signed_areas(charted.map.uv, charted.map.corners) != 0
    if not (in_plane & (charted.mesh.face_areas > 0)).any():
        raise InputError("its UVs have no area where its faces do, so no texture can show it")


def check_together(
    charted: Charted, surface: Surface, known: FloatArray | None = None, least: float = 0.5
) -> float:
    """Check that a share of a surface lies on the mesh of a model; the share that does.

    Args:
        charted: the mesh.
        surface: a cloud, or a mesh, whose vertices are looked at.
        known: (n, 3) further points of the model, or None.
        least: the share, from 0 (some point) to below 1.

    Raises:
        InputError: it does not.
    """
    mesh = charted.mesh
    points = surface.vertices[surface.referenced] if isinstance(surface, Mesh) else surface.points
    some = points[:: max(1, len(points) // COMPARED)]
    apart = np.sqrt(igl.point_mesh_squared_distance(some, mesh.vertices, mesh.faces)[0])
    if known is not None:
        apart = np.minimum(apart, cKDTree(known).query(some)[0])
    diagonal = float(np.linalg.norm(np.ptp(mesh.vertices[mesh.referenced], axis=0)))
    nearest = float(np.sort(apart)[int(least * len(apart))])
    if nearest > APART * diagonal:
        raise InputError(
            f"does not lie on the surface of the model: {'half' if least else 'all'} of its points "
            f"are {nearest:.3g} or more from it, which is {diagonal:.3g} across"
        )
    return float((apart <= APART * diagonal).mean())


Done = Callable[[float], None]
"""Is called with the share of a bake that is done, from 0 to 1."""


def unwatched(_: float) -> None:
    """What is called where nobody wants to know."""


def baked(
    charted: Charted,
    cloud: PointCloud,
    kind: str,
    size: int,
    margin: int = MARGIN,
    *,
    done: Done = unwatched,
) -> Baked:
    """The texture of a mesh with what is known at the points of a cloud of the same surface.

    Points around the mesh have a say if they have a value: finite colours and intensities, normals
    with a length. Normals are turned to the outside of the mesh where that is not their side.

    "colour" is 8-bit sRGB as the cloud has it. "normal" is an 8-bit tangent-space normal map as
    glTF has it (MikkTSpace tangents, green upwards). "intensity" is 16-bit grey from the least to
    the greatest value. "position" is a geometry image (Gu, Gortler and Hoppe 2002): 16-bit red,
    green and blue are x, y and z, and alpha tells the texels on the surface. What black and white
    mean is in `text`.

    Args:
        charted: the mesh, and its map in the unit square.
        cloud: the points.
        kind: one of MAPS.
        size: texels along a side.
        margin: texels around each chart that repeat its edge.
        done: is called on the way.

    Raises:
        InputError: the cloud has not what the map shows; the map leaves the unit square.
    """
    check_bakeable(cloud, kind)
    check_in_square(charted)
    cloud = knowing(_around(charted.mesh, cloud), kind)
    shown = texels(charted, size)
    return {"colour": _colour, "normal": _normal, "position": _position, "intensity": _intensity}[
        kind
    ](shown, cloud, margin, done)


def _around(mesh: Mesh, cloud: PointCloud) -> PointCloud:
    """The points that lie in the box of a mesh, made wider by APART of its diagonal.

    Raises:
        InputError: none do.
    """
    corners = mesh.vertices[mesh.referenced]
    reach = APART * np.linalg.norm(np.ptp(corners, axis=0))
    low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
    near = ((cloud.points >= low) & (cloud.points <= high)).all(axis=1)
    if not near.any():
        raise InputError("does not lie on the surface of the model")
    return cloud if near.all() else cloud.chosen(near)


def _colour(shown: Texels, cloud: PointCloud, margin: int, done: Done) -> Baked:
    colours = Scattered(cloud.points, unit_colours(cloud.attributes["colours"][:, :3]))
    flat = painted(shown, 3, np.uint8, lambda at, _: 255 * colours(at), done)
    return Baked(dilated(flat, shown, margin), {}, _fill(shown))


def _intensity(shown: Texels, cloud: PointCloud, margin: int, done: Done) -> Baked:
    values = cloud.attributes["intensity"].reshape(len(cloud.points), -1)[:, :1].astype(np.float64)
    low, span = _range(values)
    known = Scattered(cloud.points, (values - low) / span)
    flat = painted(shown, 1, np.uint16, lambda at, _: 65535 * known(at), done)
    text = {"intensity of black": repr(low), "intensity of white": repr(low + span)}
    return Baked(dilated(flat, shown, margin), text, _fill(shown))


def _position(shown: Texels, cloud: PointCloud, margin: int, done: Done) -> Baked:
    surface = Scattered(cloud.points, cloud.points)
    corner = cloud.points.min(axis=0)
    span = max(float(np.ptp(cloud.points, axis=0).max()), 1e-300)
    flat = painted(shown, 3, np.uint16, lambda at, _: 65535 * (surface(at) - corner) / span, done)
    alpha = np.zeros(shown.size**2, dtype=np.uint16)
    alpha[shown.places[shown.inside]] = 65535
    filled = dilated(flat, shown, margin)
    pixels = np.concatenate([filled, alpha.reshape(*filled.shape[:2], 1)], axis=2)
    text = {
        "position of black": " ".join(map(repr, corner.tolist())),
        "position of white": " ".join(map(repr, (corner + span).tolist())),
    }
    return Baked(pixels, text, _fill(shown))


def _normal(shown: Texels, cloud: PointCloud, margin: int, done: Done) -> Baked:
    cloud = facing_outwards(cloud, shown.charted.mesh)
    assert cloud.normals is not None
    length = np.linalg.norm(cloud.normals, axis=1, keepdims=True)
    known = Scattered(cloud.points, cloud.normals / length)
    seen_from = in_tangent_space(shown)

    def values(at: FloatArray, rows: slice) -> FloatArray:
        return np.asarray(127.5 * (seen_from(known(at), rows) + 1))

    flat = painted(shown, 3, np.uint8, values, done)
    return Baked(dilated(flat, shown, margin), {}, _fill(shown))


def _range(values: FloatArray) -> tuple[float, float]:
    """The least value, and the span of all, which is 1 where all are equal."""
    low = float(values.min())
    return low, float(values.max()) - low or 1.0


def _fill(shown: Texels) -> float:
    return float(shown.inside.sum() / shown.size**2)


def painted(
    shown: Texels,
    channels: int,
    kind: type[np.uint8 | np.uint16],
    values: Callable[[FloatArray, slice], FloatArray],
    done: Done = unwatched,
) -> Pixels:
    """(K, channels) rounded values at the texels, a batch at a time.

    Args:
        shown: the texels.
        channels: numbers at each.
        kind: type of the result.
        values: gives them for places (k, 3) on the mesh, which are these rows of `shown`.
        done: is called on the way.
    """
    corners = shown.charted.mesh.vertices[shown.charted.mesh.faces]
    flat = np.empty((len(shown.places), channels), dtype=kind)
    for rows in _batches(len(flat)):
        at = np.einsum("nc,ncd->nd", shown.weights(rows), corners[shown.faces[rows]])
        flat[rows] = np.clip(np.rint(values(at, rows)), 0, np.iinfo(kind).max)
        done(min(rows.stop / len(flat), 1.0))
    return flat


def _batches(count: int) -> Iterator[slice]:
    return (slice(k, k + BATCH) for k in range(0, count, BATCH))


def dilated(flat: Pixels, shown: Texels, margin: int) -> Pixels:
    """(N, N, c) the image: texels of the surface, their edge repeated, and their mean elsewhere.

    There it is opaque, if it has an alpha.
    """
    size = shown.size
    image: npt.NDArray[Any] = np.empty((size * size, flat.shape[1]), dtype=flat.dtype)
    image[:] = np.rint(flat.mean(axis=0))
    image[:, 3:] = np.iinfo(flat.dtype).max
    image[shown.places] = flat
    empty = np.ones((size, size), dtype=bool)
    empty.reshape(-1)[shown.places] = False
    square: Pixels = image.reshape(size, size, -1)
    if margin > 0 and empty.any() and not empty.all():
        distance, (line, column) = ndimage.distance_transform_edt(empty, return_indices=True)
        around = empty & (distance <= margin)
        square[around] = square[line[around], column[around]]
    return square
