"""What a file paints on its mesh: pictures with the UVs they were drawn for, and flat colours."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from parapoint.files.attributes import srgb
from parapoint.files.meshes.gltf import Gltf, base_colour, image_of, opened
from parapoint.files.meshes.gltf_primitives import draws_triangles
from parapoint.files.meshes.materials import libraries, material_names, materials_of
from parapoint.files.meshes.pictures import (
    Material,
    Picture,
    Wrap,
    bare_name,
    named_file,
    read_picture,
    readable,
)
from parapoint.files.meshes.ply import face_colours, pictures_of
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

WRAPS: dict[int, Wrap] = {33648: "mirror", 33071: "clamp"}
"""How a picture goes on beyond its edges, by glTF's numbers; it repeats by any other."""
KTX = b"\xabKTX"
"""How a picture begins that is packed for graphics cards (KHR_texture_basisu)."""

logger = logging.getLogger("parapoint")


@dataclass(frozen=True, eq=False)
class Painting:
    """What is painted on the triangles of a mesh.

    Attributes:
        materials: by number.
        material_of: (F,) number of the material of each triangle.
        uv: (F, 3, 2) where its corners lie in the picture of its material; v runs upwards.
    """

    materials: tuple[Material, ...]
    material_of: IntArray
    uv: FloatArray

    @property
    def largest(self) -> int:
        """Texels along the longest side of all pictures; 0 without any."""
        shapes = [of.picture.shape[:2] for of in self.materials if of.picture is not None]
        return max((max(shape) for shape in shapes), default=0)

    def of_faces(self, chosen: BoolArray) -> Painting:
        """What is painted on some of the triangles (F,)."""
        return Painting(self.materials, self.material_of[chosen], self.uv[chosen])


def painting_of(path: Path, polygon_of: IntArray, uv: FloatArray | None) -> Painting | None:
    """What a mesh file paints on its triangles; None where that is one colour alone.

    Args:
        path: an OBJ, PLY or glTF file that was read.
        polygon_of: (F,) the polygon of the file that each triangle is part of.
        uv: (F, 3, 2) the UVs of the file at its corners, NaN where it has none; None without any.

    Raises:
        InputError: a picture cannot be read or is too large.
    """
    of = {".obj": _obj, ".ply": _ply, ".glb": _gltf, ".gltf": _gltf}.get(path.suffix.lower())
    if of is None:
        return None
    materials, material_of = of(path)
    used = material_of[polygon_of]
    if uv is None:  # no picture can be seen
        materials = tuple(Material(one.colour) for one in materials)
        uv = np.full((len(polygon_of), 3, 2), np.nan)
    seen = [materials[k] for k in np.unique(used)]
    if len({one.colour for one in seen}) < 2 and all(one.picture is None for one in seen):
        return None
    scales = np.array([one.scale for one in materials])[used, None]
    offsets = np.array([one.offset for one in materials])[used, None]
    return Painting(materials, used, uv * scales + offsets)


def _obj(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    known = materials_of(libraries(path)[0])
    names, of = material_names(path.read_bytes())
    found = [name if name in known else readable(bare_name(name)) for name in names]
    unknown = [name for name in found if name and name not in known]
    if known and unknown:
        logger.warning("%s: no library holds its materials %s", path, ", ".join(unknown))
    return tuple(known.get(name, Material()) for name in found), of


def _ply(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    names, number_of = pictures_of(path)
    if not names and (colours := face_colours(path)) is not None:
        distinct, of = np.unique(colours, axis=0, return_inverse=True)
        flat = [(red, green, blue) for red, green, blue in distinct.tolist()]
        return tuple(Material(colour) for colour in flat), of.reshape(-1)
    materials = []
    for name in names:
        found = named_file(path.parent, name)
        if found is None:
            logger.warning("%s: the picture %s is not found", path, readable(name))
        materials.append(Material(picture=None if found is None else read_picture(found)))
    return (*materials, Material()), np.where(number_of < len(names), number_of, len(names))


def _gltf(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    tree = opened(path)
    pictures: dict[int | None, Picture | None] = {None: None}
    materials = []
    for given in tree.tree.get("materials", []):
        factor, shown = base_colour(given)
        linear = np.clip(np.array(factor[:3], np.float64), 0, 1)
        red, green, blue = np.rint(255 * srgb(linear)).astype(int).tolist()
        texture = tree.tree["textures"][shown["index"]] if "index" in shown else {}
        source = image_of(texture)
        if source is not None and source not in pictures:
            pictures[source] = _image(path, tree, source)
        picture, wraps = pictures[source], _wraps(tree.tree, texture)
        if picture is not None:
            picture = _with_alpha(picture, given, factor[3])
        materials.append(Material((red, green, blue), picture, wraps=wraps))
    materials.append(Material())
    of = [
        np.full(len(tree.triangles(one)), one.get("material", len(materials) - 1))
        for one in (placed.primitive for placed in tree.placed_primitives())
        if draws_triangles(one)
    ]
    return tuple(materials), np.concatenate(of)


def _image(path: Path, scene: Gltf, index: int) -> Picture | None:
    """An image of a glTF file; None with a warning where it is packed as KTX 2."""
    data, name = scene.image(index), scene.image_name(index)
    if not data.startswith(KTX):
        return read_picture(data, name)
    logger.warning(
        "%s: the picture %s is left out: KTX 2 is not read; export it as PNG or JPEG", path, name
    )
    return None


def _with_alpha(picture: Picture, material: dict[str, Any], share: float) -> Picture:
    """A picture with the alpha that a glTF material shows, which is `share` of its own.

    Where the material is cut out, all is opaque or not there.
    """
    mode, edge = material.get("alphaMode", "OPAQUE"), material.get("alphaCutoff", 0.5)
    if mode == "OPAQUE":
        return picture[..., :3]
    own = picture[..., 3] if picture.shape[2] == 4 else np.full(picture.shape[:2], 255)
    alpha = np.clip(own * share, 0, 255)
    if mode == "MASK":
        alpha = np.where(alpha >= 255 * edge, 255, 0)
    return np.dstack([picture[..., :3], np.rint(alpha).astype(np.uint8)])


def _wraps(tree: dict[str, Any], texture: dict[str, Any]) -> tuple[Wrap, Wrap]:
    """How the picture of a texture of a glTF file goes on beyond its edges, along u and v."""
    sampler = tree["samplers"][texture["sampler"]] if "sampler" in texture else {}
    u, v = (WRAPS.get(sampler.get(key, 0), "repeat") for key in ("wrapS", "wrapT"))
    return u, v
