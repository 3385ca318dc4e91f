"""Writers of meshes with their UV."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.targets import beside, complete_file, sealed_png, sealed_text
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh


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
        texture: (H, W, 3) pixels, first row at the top. With it, a material beside the OBJ
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
        image, library = beside(path, ".png"), beside(path, ".mtl")
        pixels = sealed_png(png(texture))
        with complete_file(image) as file:
            file.write(pixels)
        with complete_file(library) as file:
            file.write(sealed_text(f"newmtl map\nKd 1 1 1\nmap_Kd {image.name}\n"))
        material = f"mtllib {library.name}\nusemtl map\n"
    corners = np.stack([mesh.faces, parameterization.corners], axis=2).reshape(-1, 6) + 1
    lines = [
        material,
        *(f"v {x!r} {y!r} {z!r}\n" for x, y, z in mesh.vertices.tolist()),
        *(f"vt {u!r} {v!r}\n" for u, v in parameterization.uv.tolist()),
        *(f"f {a}/{ta} {b}/{tb} {c}/{tc}\n" for a, ta, b, tb, c, tc in corners.tolist()),
    ]
    with complete_file(path) as file:
        file.write("".join(lines).encode())


def png(pixels: npt.NDArray[np.uint8]) -> bytes:
    """A PNG file of (H, W, 3) uint8 pixels.

    Raises:
        InputError: another shape or type.
    """
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8 or pixels.size == 0:
        raise InputError(
            f"a texture must be (H, W, 3) uint8 pixels, not {pixels.shape} {pixels.dtype}"
        )
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)  # each row begins with filter 0
    rows[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)  # 8 bits of red, green, blue
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            chunk(b"IHDR", header),
            chunk(b"IDAT", zlib.compress(rows.tobytes())),
            chunk(b"IEND", b""),
        ]
    )
