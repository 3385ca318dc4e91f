"""What a file paints on its mesh: pictures with the UVs they were drawn for, and flat colours."""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.attributes import srgb
from parapoint.files.decoding import plain
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray

MOST_TEXELS = 16_384
"""Texels along a side of a picture that is read."""
OPTION = re.compile(
    r"-(?:(?:mm|[ost])(?:\s+[-+.\deE]+)+|(?:blendu|blendv|bm|boost|cc|clamp|imfchan|texres|type)"
    r"\s+\S+)\s+"
)
"""An option of a picture in a material library (Wavefront's specification)."""
WHITE = (255, 255, 255)

Picture = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Material:
    """What a material shows.

    Attributes:
        colour: where it has no picture, 8-bit sRGB.
        picture: the picture of its colour, (H, W, 3 or 4), first row at the top, or None.
    """

    colour: tuple[int, int, int] = WHITE
    picture: Picture | None = None


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


def read_picture(data: bytes | Path) -> Picture:
    """(H, W, 3 or 4) the pixels of an image file of any kind that Pillow reads.

    Raises:
        InputError: it is none, or is larger than MOST_TEXELS.
    """
    from PIL import Image

    name = f"{data}: " if isinstance(data, Path) else ""
    try:
        with Image.open(data if isinstance(data, Path) else io.BytesIO(data)) as image:
            if max(image.size) > MOST_TEXELS:
                raise InputError(f"{name}a picture of {image.size} texels is too large to bake")
            has_alpha = "A" in image.getbands() or "transparency" in image.info
            return np.asarray(image.convert("RGBA" if has_alpha else "RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{name}is no picture that can be read ({error})") from None


def materials_of(libraries: list[Path]) -> dict[str, Material]:
    """The materials in Wavefront material libraries, by name; missing files are passed over.

    A picture that is missing or cannot be read leaves its material in its colour.
    """
    found: dict[str, Material] = {}
    for library in libraries:
        if not library.is_file():
            continue
        name = ""
        for line in plain(library.read_bytes()).decode(errors="surrogateescape").splitlines():
            kind, _, rest = line.strip().partition(" ")
            rest = rest.strip()
            if kind == "newmtl":
                name = rest
                found[name] = Material()
            elif kind == "Kd" and name:
                found[name] = Material(_eight_bits(rest), found[name].picture)
            elif kind.lower() == "map_kd" and name:
                while (option := OPTION.match(rest)) is not None:
                    rest = rest[option.end() :]
                path = library.parent / rest.replace("\\", "/")
                if path.is_file():
                    found[name] = Material(found[name].colour, read_picture(path))
    return found


def _eight_bits(words: str) -> tuple[int, int, int]:
    """The colour of three words from 0 to 1; white where they are none."""
    try:
        red, green, blue = (round(255 * min(max(float(word), 0), 1)) for word in words.split()[:3])
    except ValueError:
        return WHITE
    return red, green, blue


def obj_material_names(data: bytes) -> tuple[list[str], IntArray]:
    """The names that usemtl lines of an OBJ file give, and (N,) the one of each polygon.

    Name 0 is "", of polygons before the first such line.
    """
    names, of = [""], []
    number: dict[str, int] = {"": 0}
    current = 0
    for line in re.sub(rb"\\\r?\n", b" ", plain(data)).splitlines():
        words = line.split(None, 1)
        if len(words) == 2 and words[0] in {b"f", b"fo"}:
            of.append(current)
        elif len(words) == 2 and words[0] == b"usemtl":
            name = words[1].strip().decode(errors="surrogateescape")
            current = number.setdefault(name, len(names))
            if current == len(names):
                names.append(name)
    return names, np.array(of, dtype=np.int64)


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
    return Painting(materials, used, uv)


def _obj(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    from parapoint.files.obj_rewriting import libraries

    known = materials_of(libraries(path)[0])
    names, of = obj_material_names(path.read_bytes())
    return tuple(known.get(name, Material()) for name in names), of


def _ply(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    from parapoint.files.ply_rewriting import pictures_of

    names, number_of = pictures_of(path)
    found = [path.parent / name for name in names]
    materials = [Material(picture=read_picture(one) if one.is_file() else None) for one in found]
    return (*materials, Material()), np.where(number_of < len(names), number_of, len(names))


def _gltf(path: Path) -> tuple[tuple[Material, ...], IntArray]:
    from parapoint.files.gltf import draws_triangles, opened

    tree = opened(path)
    pictures: dict[int, Picture] = {}
    materials = []
    for given in tree.tree.get("materials", []):
        base = given.get("pbrMetallicRoughness", {})
        linear = np.clip(np.array(base.get("baseColorFactor", (1, 1, 1))[:3], np.float64), 0, 1)
        red, green, blue = np.rint(255 * srgb(linear)).astype(int).tolist()
        texture = base.get("baseColorTexture", {}).get("index")
        source = None if texture is None else tree.tree["textures"][texture].get("source")
        if source is not None and source not in pictures:
            pictures[source] = read_picture(tree.image(source))
        materials.append(Material((red, green, blue), None if source is None else pictures[source]))
    materials.append(Material())
    of = [
        np.full(len(tree.triangles(one)), one.get("material", len(materials) - 1))
        for one in (placed.primitive for placed in tree.placed_primitives())
        if draws_triangles(one)
    ]
    return tuple(materials), np.concatenate(of)
