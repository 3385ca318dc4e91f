"""What a mesh shows through its old UVs, painted anew into the texture of a new map."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from parapoint.files.attributes import srgb, unit_colours
from parapoint.files.meshes.painting import Painting
from parapoint.files.meshes.pictures import WHITE, Picture, Wrap
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import FloatArray, IntArray
from parapoint.textures.baking import MARGIN, Done, dilated, painted, unwatched
from parapoint.textures.texels import texels


def repainted(
    charted: Charted,
    painting: Painting,
    size: int,
    margin: int = MARGIN,
    *,
    tints: bool = False,
    colours: npt.NDArray[np.generic] | None = None,
    done: Done = unwatched,
) -> Picture:
    """(size, size, 3 or 4) the texture of a mesh with what its file paints on it.

    Pictures go on outside of the unit square as their materials say, and are interpolated between
    their texels. Four channels where what is seen of a picture is not opaque.

    Args:
        charted: the mesh, and its new map in the unit square.
        painting: what is painted on its triangles, in their order.
        size: texels along a side.
        margin: texels around each chart that repeat its edge.
        tints: whether the colour of a material tints its picture, as it does in glTF.
        colours: (V, 3 or 4) of the vertices, as `PointCloud` has them, or None; they tint pictures
            in place of the material's colour, which they hold.
        done: is called on the way.
    """
    shown = texels(charted, size)
    has_alpha = any(
        one.picture is not None and one.picture.shape[2] == 4 for one in painting.materials
    )
    width = 4 if has_alpha else 3
    light = None if colours is None else _linear(_known(colours))
    flat_colours = np.array([one.colour for one in painting.materials], dtype=np.float64)
    is_even = np.array([one.picture is None and light is None for one in painting.materials])

    def values(_: FloatArray, rows: slice) -> FloatArray:
        faces = shown.faces[rows]
        weights = np.maximum(shown.weights(rows), 0)  # beyond the old chart is another one
        weights /= weights.sum(axis=1, keepdims=True)
        uv = np.einsum("nc,ncd->nd", weights, painting.uv[faces])
        out = np.full((len(faces), width), 255.0)
        of = painting.material_of[faces]
        out[:, :3] = flat_colours[of]
        for number in np.unique(of[~is_even[of]]).tolist():
            material, here = painting.materials[number], of == number
            tint = None if material.colour == WHITE else _linear(np.array(material.colour) / 255)
            if light is not None:
                corners = light[charted.mesh.faces[faces[here]]]
                tint = np.einsum("nc,ncd->nd", weights[here], corners)
            out[here] = 255.0
            if material.picture is not None:
                out[here] = _seen(material.picture, material.wraps, uv[here], width)
            if tint is not None and (tints or material.picture is None):
                out[here, :3] = 255 * srgb(tint * _linear(out[here, :3] / 255))
        return out

    flat = painted(shown, width, np.uint8, values, done)
    if (flat[:, 3:] == 255).all():
        flat = flat[:, :3]
    return dilated(flat, shown, margin).astype(np.uint8, copy=False)


def coloured(
    charted: Charted,
    colours: npt.NDArray[np.generic],
    size: int,
    margin: int = MARGIN,
    *,
    done: Done = unwatched,
) -> Picture:
    """(size, size, 3) the texture of a mesh whose vertices (V,) have colours, as `PointCloud`.

    Vertices without a colour are white.
    """
    shown = texels(charted, size)
    known = 255 * _known(colours)

    def values(_: FloatArray, rows: slice) -> FloatArray:
        corners = known[charted.mesh.faces[shown.faces[rows]]]
        return np.asarray(np.einsum("nc,ncd->nd", shown.weights(rows), corners))

    flat = painted(shown, 3, np.uint8, values, done)
    return dilated(flat, shown, margin).astype(np.uint8, copy=False)


def _known(colours: npt.NDArray[np.generic]) -> FloatArray:
    """(V, 3) colours from 0 to 1; white where they are not known."""
    return np.nan_to_num(unit_colours(colours[:, :3]).astype(np.float64), nan=1.0)


def _linear(parts: FloatArray) -> FloatArray:
    """Parts of sRGB colours, from 0 to 1, as parts of linear ones."""
    return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)


def _wrapped(index: IntArray, count: int, wrap: Wrap) -> IntArray:
    """(n,) the rows of `count` that are seen where rows of any number are looked for."""
    if wrap == "clamp":
        return np.clip(index, 0, count - 1)
    if wrap == "mirror":
        index = index % (2 * count)
        return np.minimum(index, 2 * count - 1 - index)
    return index % count


def _seen(picture: Picture, wraps: tuple[Wrap, Wrap], uv: FloatArray, width: int) -> FloatArray:
    """(n, width) a picture at points (n, 2), as it goes on; white where a point is NaN."""
    height, across, channels = picture.shape
    known = np.asarray(np.isfinite(uv).all(axis=1))
    at = np.where(known[:, None], uv, 0)
    at = np.stack([(1 - at[:, 1]) * height, at[:, 0] * across], axis=1) - 0.5
    low = np.floor(at)
    part = at - low
    line, column = low.astype(np.int64).T
    total = np.zeros((len(uv), channels))
    for down in (0, 1):
        for right in (0, 1):
            weight = np.abs(1 - down - part[:, 0]) * np.abs(1 - right - part[:, 1])
            lines = _wrapped(line + down, height, wraps[1])
            columns = _wrapped(column + right, across, wraps[0])
            total += weight[:, None] * picture[lines, columns]
    out = np.full((len(uv), width), 255.0)
    out[known, :channels] = total[known, :width]
    out[~known, :3] = WHITE
    return out
