"""Writers of meshes with their UV."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.png import png
from parapoint.files.targets import beside, complete_file, sealed_png, sealed_text
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.sides import parted
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, vertex_normals

BETWEEN = (0.1, 0.9)
"""Alphas that are neither none nor full."""
EDGES = 0.4
"""Share of the texels that are not opaque whose alpha may lie between where shapes are cut out.

Of leaves and stripes it was 0.13 to 0.32, since their edges blur when they are painted anew.
"""


def write_obj(
    path: str | Path,
    mesh: Mesh,
    parameterization: Parameterization,
    texture: npt.NDArray[np.uint8] | None = None,
) -> None:
    """Write a mesh and its map as OBJ: v, vt and f with both indices, exact to the last bit.

    Args:
        path: the OBJ file; it appears only when it is complete.
        mesh: the mesh.
        parameterization: its map.
        texture: (H, W, 3 or 4) pixels, first row at the top. With it, a material beside the OBJ
            (same name, .mtl) shows it (same name, .png).

    Raises:
        InputError: the map has another number of faces than the mesh, or the texture another shape.
        OSError: a file cannot be written; nothing of the OBJ is left behind.
    """
    path = Path(path)
    if len(mesh.faces) != len(parameterization.corners):
        raise InputError(
            f"{path}: a map of {len(parameterization.corners)} faces cannot be written "
            f"with a mesh of {len(mesh.faces)}"
        )
    material = ""
    if texture is not None:
        material = write_material(path, texture)
    corners = np.stack([mesh.faces, parameterization.corners], axis=2).reshape(-1, 6) + 1
    lines = [
        material,
        *(f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist()),
        *(f"vt {u!r} {v!r}\n" for u, v in parameterization.uv.tolist()),
        *(f"f {a}/{ta} {b}/{tb} {c}/{tc}\n" for a, ta, b, tb, c, tc in corners.tolist()),
    ]
    with complete_file(path) as file:
        file.write("".join(lines).encode(errors="surrogateescape"))


def write_material(path: Path, texture: npt.NDArray[np.uint8], names: Iterable[str] = ()) -> str:
    """Write a texture (.png) and its material (.mtl) beside an OBJ file; the lines that use it.

    The material is there under each of the other `names`, too.
    """
    image, library = write_picture(path, texture), beside(path, ".mtl")
    shown = f"Kd 1 1 1\nmap_Kd {image.name}\n"
    if alpha_mode(texture) != "OPAQUE":
        shown += f"map_d {image.name}\n"
    materials = "".join(f"newmtl {name}\n{shown}" for name in dict.fromkeys(["map", *names]))
    with complete_file(library) as file:
        file.write(sealed_text(materials))
    return f"mtllib {library.name}\nusemtl map\n"


def alpha_mode(texture: npt.NDArray[np.uint8]) -> Literal["OPAQUE", "MASK", "BLEND"]:
    """How glTF shows the alpha of a texture (H, W, 3 or 4): not at all, cut at a half, or mixed."""
    alpha = texture[..., 3:]
    clear = np.count_nonzero(alpha < 255)
    if not clear:
        return "OPAQUE"
    low, high = 255 * BETWEEN[0], 255 * BETWEEN[1]
    between = np.count_nonzero((alpha > low) & (alpha < high))
    return "MASK" if between <= EDGES * clear else "BLEND"


def write_textured(path: str | Path, charted: Charted, texture: npt.NDArray[np.uint8]) -> None:
    """Write a textured mesh as .obj, .glb or .ply.

    Raises:
        InputError: another ending.
        OSError: a file cannot be written; nothing of the mesh is left behind.
    """
    ending = Path(path).suffix.lower()
    if ending == ".obj":
        write_obj(path, *charted, texture)
    elif ending == ".glb":
        write_glb(path, charted, texture)
    elif ending == ".ply":
        write_ply(path, charted, texture)
    else:
        raise InputError(f"{path}: a textured mesh is written as .obj, .glb or .ply")


def write_picture(path: Path, texture: npt.NDArray[np.uint8 | np.uint16]) -> Path:
    """Write a texture beside a file, under its name; the file."""
    image = beside(path, ".png")
    pixels = sealed_png(png(texture))
    with complete_file(image) as file:
        file.write(pixels)
    return image


class _Split(NamedTuple):
    """A mesh whose vertices are repeated along the seams of its map, one uv each.

    Attributes:
        points: (V, 3).
        normals: (V, 3) unit normals of the whole surface, so that seams do not show.
        uv: (V, 2).
        faces: (F, 3).
    """

    points: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: IntArray

    @classmethod
    def of(cls, charted: Charted) -> Self:
        mesh, held = parted(charted.mesh), charted.map
        pairs = np.stack([mesh.faces, held.corners], axis=2).reshape(-1, 2)
        pairs, row = np.unique(pairs, axis=0, return_inverse=True)
        normals = vertex_normals(mesh)[pairs[:, 0]]
        points = mesh.vertices[pairs[:, 0]]
        return cls(points, normals, held.uv[pairs[:, 1]], row.reshape(-1, 3))


def write_glb(path: str | Path, charted: Charted, texture: npt.NDArray[np.uint8]) -> None:
    """Write a textured mesh as binary glTF 2, the texture inside.

    Positions are of single precision there, so they are written around the middle of the mesh,
    and the node carries it to its place. A mesh with a boundary shows both of its sides.

    Raises:
        OSError: the file cannot be written; nothing is left behind.
    """
    import trimesh
    from PIL import Image
    from trimesh.visual.material import PBRMaterial

    split = _Split.of(charted)
    middle = (split.points.min(axis=0) + split.points.max(axis=0)) / 2
    picture, mode = Image.fromarray(texture), alpha_mode(texture)
    material = PBRMaterial(  # type: ignore[no-untyped-call]  # trimesh's
        baseColorTexture=picture,
        metallicFactor=0.0,
        roughnessFactor=1.0,
        alphaMode=None if mode == "OPAQUE" else mode,
        alphaCutoff=0.5 if mode == "MASK" else None,
        doubleSided=bool((charted.mesh.edge_face_count == 1).any()),
    )
    mesh = trimesh.Trimesh(
        split.points - middle,
        split.faces,
        vertex_normals=split.normals,
        visual=trimesh.visual.TextureVisuals(split.uv, material=material),  # type: ignore[no-untyped-call]  # trimesh's
        process=False,
    )
    place = np.eye(4)
    place[:3, 3] = middle
    scene = trimesh.Scene()
    scene.add_geometry(mesh, transform=place)
    data = scene.export(file_type="glb", include_normals=True)  # type: ignore[no-untyped-call]  # trimesh's
    with complete_file(Path(path)) as file:
        file.write(data)


def write_npz(path: str | Path, charted: Charted) -> None:
    """Write a mesh and its map as NumPy arrays: vertices, faces, uv and corners.

    Raises:
        OSError: the file cannot be written; nothing is left behind.
    """
    mesh, held = charted
    with complete_file(Path(path)) as file:
        np.savez_compressed(
            file, vertices=mesh.vertices, faces=mesh.faces, uv=held.uv, corners=held.corners
        )


def write_ply(
    path: str | Path, charted: Charted, texture: npt.NDArray[np.uint8] | None = None
) -> None:
    """Write a mesh as PLY: s and t at the vertices, and the texture, if any, beside it (.png).

    Blender reads s and t; MeshLab reads the list "texcoord" of each face and the comment that
    names the texture.

    Raises:
        OSError: a file cannot be written; nothing of the PLY is left behind.
    """
    path = Path(path)
    named = []
    if texture is not None:
        named = [f"comment TextureFile {write_picture(path, texture).name}"]
    split = _Split.of(charted)
    header = [
        "ply",
        "format binary_little_endian 1.0",
        *named,
        f"element vertex {len(split.points)}",
        *(f"property double {axis}" for axis in "xyz"),
        *(f"property float {name}" for name in ("nx", "ny", "nz")),
        *(f"property double {name}" for name in "st"),
        f"element face {len(split.faces)}",
        "property list uchar int vertex_indices",
        "property list uchar float texcoord",
        "end_header\n",
    ]
    vertices = np.zeros(
        len(split.points), [("at", "<f8", 3), ("normal", "<f4", 3), ("uv", "<f8", 2)]
    )
    vertices["at"], vertices["normal"], vertices["uv"] = split.points, split.normals, split.uv
    lists = [("n", "u1"), ("row", "<i4", 3), ("m", "u1"), ("uv", "<f4", (3, 2))]
    faces = np.zeros(len(split.faces), lists)
    faces["n"], faces["row"], faces["m"], faces["uv"] = 3, split.faces, 6, split.uv[split.faces]
    with complete_file(path) as file:
        file.write("\n".join(header).encode(errors="surrogateescape"))
        file.write(vertices.tobytes())
        file.write(faces.tobytes())
