"""`python -m benchmarks.checks.wild`: read files as other tools write them, family by family.

A few lines make each file here, so it is known what the file means, and it must be read that way.
Only where a file does not show what it means may it be refused instead, with one line. The command
prints for each family how many files were read, refused and wrong. It exits with 1 if one is wrong.
"""

from __future__ import annotations

import base64
import json
import logging
import struct
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from baselines import registry
from benchmarks.checks import wild_clouds
from benchmarks.checks.wild_case import POINTS, SEED, Case, cannot_be_told, shows
from benchmarks.metrics.evaluation import evaluate
from parapoint import console
from parapoint.commands.mesh_output import mesh_output
from parapoint.commands.unwrapping import Request, unwrap_mesh
from parapoint.errors import InputError
from parapoint.files.reading import Polygons, read_parameterized, read_polygons
from parapoint.surfaces.surface import FloatArray, IntArray, unit_normals
from parapoint.textures.placing import BORDER
from parapoint.unwrapping.unwrap import Unwrap


class Tally(NamedTuple):
    """How many files of a family were read and how many refused, and the names of wrong ones."""

    read: int
    refused: int
    wrong: list[str]


def tally(cases: list[Case], folder: Path) -> Tally:
    """Write and read each file of a family."""
    read, refused, wrong = 0, 0, []
    for case in cases:
        path = folder / case.name
        path.write_bytes(case.data)
        try:
            is_right = case.is_right(path)
            read += is_right
        except InputError:
            refused += 1
            is_right = case.may_refuse
        if not is_right:
            wrong.append(case.name)
    return Tally(read, refused, wrong)


def commas() -> Iterator[Case]:
    """Decimal commas, with each kind of separator between the numbers."""
    text = ["\n".join(" ".join(f"{x:g}" for x in row) for row in POINTS)]
    decimal = text[0].replace(".", ",")
    variants = {
        "blanks": decimal,
        "tabs": decimal.replace(" ", "\t"),
        "semicolons": decimal.replace(" ", ";"),
        "spaced": decimal.replace(" ", ", "),
        "heading": "X;Y;Z\n" + decimal.replace(" ", ";"),
        "quoted": "\n".join(
            ";".join(f'"{word}"' for word in line.split()) for line in decimal.splitlines()
        ),
        "csv": text[0].replace(" ", ","),
    }
    for name, lines in variants.items():
        yield Case(f"{name}.xyz", lines.encode(), shows(POINTS))
    yield Case("untold.xyz", b"1,5,2,5,3,5\n" * 3, cannot_be_told, may_refuse=True)


def marks() -> Iterator[Case]:
    """Every text format with a byte order mark, in characters of one, two and four bytes."""
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    obj = "".join(f"v {x} {y} {z}\n" for x, y, z in triangle) + "f 1 2 3\n"
    off = "OFF\n3 1 0\n" + "".join(f"{x} {y} {z}\n" for x, y, z in triangle) + "3 0 1 2\n"
    ply = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(
        f"property float {name}\n" for name in "xyz"
    )
    ply += "end_header\n" + "".join(f"{x} {y} {z}\n" for x, y, z in triangle)
    xyz = "".join(f"{x} {y} {z}\n" for x, y, z in triangle)
    for ending, text in {".obj": obj, ".off": off, ".ply": ply, ".xyz": xyz, ".pts": xyz}.items():
        for encoding in ("utf-8-sig", "utf-16", "utf-32"):
            yield Case(f"{encoding}{ending}", text.encode(encoding), shows(triangle))


def polygons() -> Iterator[Case]:
    """Concave polygons, and one with a bridge to a hole, to be cut without a fold."""
    turn = 2 * np.pi * np.arange(24) / 24
    flower = np.stack([np.cos(turn), np.sin(turn)], 1) * (1 + 0.4 * np.cos(6 * turn))[:, None]
    shapes: dict[str, Any] = {
        "l": [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)],
        "arrow": [(0, 0), (2, 1), (0, 2), (0.5, 1)],
        "keyhole": [
            *[(0, 0), (4, 0), (4, 4), (0, 4), (0, 0)],
            *[(1, 1), (1, 3), (3, 3), (3, 1), (1, 1)],
        ],
        "comb": [(0, 0), (11, 0), *((11 - k, 1 if k % 2 else 5) for k in range(12))],
        "flower": flower,
    }
    for name, shape in shapes.items():
        x, y = np.array(shape, dtype=float).T
        area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
        for first in (0, 2):
            order = np.roll(np.arange(len(x)), first)
            lines = [f"v {x[k]} {y[k]} 0" for k in order] + [f"vt {x[k]} {y[k]}" for k in order]
            corners = " ".join(f"{k}/{k}" for k in range(1, len(x) + 1))
            data = "\n".join([*lines, f"f {corners}\n"]).encode()
            yield Case(f"{name}{first}.obj", data, partial(_is_flat, area=area))


def _is_flat(path: Path, area: float) -> bool:
    """Whether the map of a flat shape onto itself is perfect, and its area is this."""
    mesh, flat = read_parameterized(path)
    values = evaluate(mesh, flat)
    perfect = values["flipped_fraction"] == values["overlapped_fraction"] == 0
    return bool(perfect and np.isclose(mesh.face_areas.sum(), area))


def split_vertices() -> Iterator[Case]:
    """A tube cut along a line, with vertices doubled there, or at each corner, or rounded."""
    i, j = np.meshgrid(np.arange(13), np.arange(5), indexing="ij")
    uv = np.stack([i / 12, j / 4], axis=2).reshape(-1, 2)
    angle = 2 * np.pi * uv[:, 0]
    vertices = np.stack([np.cos(angle), np.sin(angle), 4 * uv[:, 1]], axis=1)
    row = np.arange(65).reshape(13, 5)
    a, b, c, d = row[:-1, :-1], row[1:, :-1], row[1:, 1:], row[:-1, 1:]
    faces = np.concatenate([np.stack(of, axis=-1).reshape(-1, 3) for of in ((a, b, c), (a, c, d))])
    corner = np.arange(faces.size).reshape(-1, 3)
    soup = vertices[faces].reshape(-1, 3), uv[faces].reshape(-1, 2), corner
    rounded = vertices.astype(np.float32).astype(float), uv, faces
    for name, (points, images, rows) in {
        "doubled": (vertices, uv, faces),
        "soup": soup,
        "rounded": rounded,
    }.items():
        yield Case(f"{name}.obj", _obj(points, images, rows), _is_tube)
        yield Case(
            f"{name}.npz", _npz(vertices=points, faces=rows, uv=images, corners=rows), _is_tube
        )
        yield Case(f"{name}.gltf", _gltf(points, images, rows), _is_tube)


def _is_tube(path: Path) -> bool:
    """Whether the map has one chart and, as its seam, one line along the tube."""
    mesh, flat = read_parameterized(path)
    values = evaluate(mesh, flat)
    seam = 4 / np.sqrt(mesh.face_areas.sum())
    return values["chart_count"] == 1 and bool(np.isclose(values["seam_length"], seam, rtol=1e-4))


def _obj(vertices: FloatArray, uv: FloatArray, faces: IntArray) -> bytes:
    lines = ["v {} {} {}".format(*row) for row in vertices.tolist()]
    lines += ["vt {} {}".format(*row) for row in uv.tolist()]
    lines += ["f " + " ".join(f"{k}/{k}" for k in row) for row in (faces + 1).tolist()]
    return ("\n".join(lines) + "\n").encode()


def _npz(**arrays: Any) -> bytes:
    with tempfile.TemporaryFile() as file:
        np.savez(file, **arrays)
        file.seek(0)
        return file.read()


def _gltf(vertices: FloatArray, uv: FloatArray, faces: IntArray, **changes: Any) -> bytes:
    """A glTF file with its buffer inside; glTF's v runs downwards."""
    blocks = [
        vertices.astype("<f4").tobytes(),
        (uv * [1, -1] + [0, 1]).astype("<f4").tobytes(),
        faces.astype("<u4").tobytes(),
    ]
    starts = np.cumsum([0, *map(len, blocks)]).tolist()
    uri = "data:application/octet-stream;base64," + base64.b64encode(b"".join(blocks)).decode()
    counts = [(5126, len(vertices), "VEC3"), (5126, len(uv), "VEC2"), (5125, faces.size, "SCALAR")]
    tree: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": uri, "byteLength": starts[-1]}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": at, "byteLength": len(block)}
            for at, block in zip(starts, blocks, strict=False)
        ],
        "accessors": [
            {"bufferView": k, "componentType": kind, "count": count, "type": shape}
            for k, (kind, count, shape) in enumerate(counts)
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2}]}
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return json.dumps(tree | changes).encode()


def gltf() -> Iterator[Case]:
    """Nodes that mirror, scale, nest and repeat a mesh, and extensions that a file needs."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    given = square, square[:, :2], np.array([[0, 1, 2], [0, 2, 3]])
    moved = {"translation": [5, 0, 0]}
    for name, nodes, faces, area in (
        ("plain", [{"mesh": 0}], 2, 1),
        ("mirrored", [{"mesh": 0, "scale": [-1, 1, 1]}], 2, 1),
        ("scaled", [{"mesh": 0, "scale": [2, 3, 1]}], 2, 6),
        ("twice", [{"mesh": 0}, {"mesh": 0, **moved}], 4, 2),
        ("nested", [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, **moved}], 2, 4),
    ):
        roots = [0, 1] if name == "twice" else [0]
        data = _gltf(*given, nodes=nodes, scenes=[{"nodes": roots}])
        yield Case(f"{name}.gltf", data, partial(_faces_up, faces=faces, area=area))
    for name in ("KHR_draco_mesh_compression", "EXT_meshopt_compression"):
        data = _gltf(*given, extensionsRequired=[name])
        yield Case(f"{name}.gltf", data, cannot_be_told, may_refuse=True)


def writers() -> Iterator[Case]:
    """A square, as modellers, CAD programs, scanners and surveyors write it."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    lines = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    for number, text in enumerate(
        (
            lines + "f -4 -3 -2 -1\n",
            lines.replace("\n", " 1.0\n") + "f 1 2 3 4\n",
            lines.replace("\n", " 0.1 0.2 0.3\n") + "f 1 2 3 4\n",
            lines.replace("\n", " # c\n") + "f 1 2 \\\n3 \\\n 4 # quad\n",
            (lines + "f 1 2 3 4").replace("\n", "\r\n").replace(" ", "\t"),
            (lines + "f 1 2 3 4").replace("\n", "\r"),
            lines + "vn 0 0 1\nl 1 2\np 1 2\nf 1//1 2//1 3//1 4//1\n",
        )
    ):
        yield Case(f"writer_{number}.obj", text.encode(), shows(square))
    for line in ("surf 0 1 0 1 1 2 3 4", "curv 0 1 1 2 3 4"):
        data = f"{lines}cstype bspline\n{line}\nend\n".encode()
        yield Case(f"{line[:4]}.obj", data, cannot_be_told, may_refuse=True)
    for order, kind in (("<", "little"), (">", "big")):
        for index, code in (("uchar", "B"), ("ushort", "H"), ("int", "i"), ("int64", "q")):
            header = (
                f"ply\nformat binary_{kind}_endian 1.0\ncomment end_header comes later\n"
                "element vertex 4\nproperty double z\nproperty uchar red\nproperty float x\n"
                f"property float y\nelement face 1\nproperty list uint {index} vertex_index\n"
                "end_header\n"
            )
            body = b"".join(struct.pack(order + "dBff", z, 7, x, y) for x, y, z in square)
            body += struct.pack(f"{order}I4{code}", 4, 0, 1, 2, 3)
            yield Case(f"{kind}_{index}.ply", header.encode() + body, shows(square))
    for number, heading in enumerate(
        ("//X Y Z Scalar_1", "X [m] Y [m] Z [m] I", "x y z i\nm m m 1/1", "Easting North Height C2")
    ):
        text = heading + "\n" + "".join("{} {} {} 0.5\n".format(*row) for row in POINTS)
        yield Case(f"heading_{number}.xyz", text.encode(), shows(POINTS))


def spellings() -> Iterator[Case]:
    """Numbers as Fortran writes them; what Windows writes for no number, which is no point."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    rows = ["{} {} {}".format(*row) for row in square]
    table = "\n".join(rows) + "\n"
    obj = "".join(f"v {row}\n" for row in rows) + "f 1 2 3 4\n"
    ply = "ply\nformat ascii 1.0\nelement vertex 4\n"
    ply += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    pcd = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 4\nDATA ascii\n"
    texts = {".xyz": table, ".obj": obj, ".off": f"OFF\n4 1 0\n{table}4 0 1 2 3\n"}
    texts |= {".ply": ply + table, ".pcd": pcd + table, ".pts": f"4\n{table}"}
    for ending, text in texts.items():
        yield Case(f"fortran{ending}", text.replace("1.0 ", "0.1D+01 ").encode(), shows(square))
        for number, word in enumerate(("1.#QNAN", "-1.#IND00", "1.#INF", "-nan(ind)")):
            data = text.replace("1.0 1.0 0.0", f"1.0 1.0 {word}").encode()
            is_mesh = ending in {".obj", ".off"}
            is_right = cannot_be_told if is_mesh else shows(square[[0, 1, 3]])
            yield Case(f"windows_{number}{ending}", data, is_right, may_refuse=is_mesh)
    ptx = f"2\n2\n{table}" + "1 0 0 0\n0 1 0 0\n0 0 1 0\n5 5 5 1\n" + table.replace("\n", " 0\n")
    yield Case("ptx.xyz", ptx.encode(), cannot_be_told, may_refuse=True)
    yield Case("ptx.pts", ptx.encode(), cannot_be_told, may_refuse=True)


def stl() -> Iterator[Case]:
    """Text STL: solids whose names hold words of the format, ends of lines, upper case."""
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    facets = "".join(
        "facet normal 0 0 1\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*row) for row in square[list(rows)])
        + "endloop\nendfacet\n"
        for rows in ((0, 1, 2), (0, 2, 3))
    )
    names = ("", "my part (2)", "facet normal 1 2 3", "vertex 9 9 9", "endsolid", "solid loop 1e3")
    for number, name in enumerate(names):
        text = f"solid {name}\n{facets}endsolid {name}\n"
        for kind, end in (("unix", "\n"), ("dos", "\r\n"), ("mac", "\r")):
            yield Case(f"{kind}_{number}.stl", text.replace("\n", end).encode(), shows(square))
        yield Case(f"upper_{number}.stl", text.upper().encode(), shows(square))


def _faces_up(path: Path, faces: int, area: float) -> bool:
    """Whether there are this many faces, with this total area, which all face upwards."""
    mesh, flat = read_parameterized(path)
    up = unit_normals(mesh.vertices, mesh.faces)[:, 2]
    whole = len(flat.corners) == len(mesh.faces) == faces and (up > 0).all()
    return bool(whole and np.isclose(mesh.face_areas.sum(), area))


def written() -> Iterator[Case]:
    """Pyramids, unwrapped and read back. Tutte's embedding of one is SLIM's minimum already."""
    for sides, ending in enumerate((".ply", ".npz", ".glb", ".obj", ".ply"), start=3):
        turn = 2 * np.pi * np.arange(sides) / sides
        rim = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        lines = ["v {} {} {}".format(*row) for row in [[0.0, 0, 1], *rim.tolist()]]
        lines += [f"f 1 {k + 2} {(k + 1) % sides + 2}" for k in range(sides)]
        inner = np.cos(np.pi / sides)  # distance of a side of the rim from its middle
        area = sides * np.sin(np.pi / sides) * np.hypot(1, inner)
        is_right = partial(_is_written, ending=ending, faces=sides, area=area)
        yield Case(f"pyramid_{sides}.obj", ("\n".join(lines) + "\n").encode(), is_right)


def _is_written(path: Path, ending: str, faces: int, area: float) -> bool:
    """Whether SLIM maps the surface, and `unwrap` writes it with its own faces, not mirrored."""
    given = read_polygons(path)
    assert isinstance(given, Polygons)
    registry.method("slim")[1].parameterize(given.mesh, seed=SEED)
    out = path.with_name(f"{path.stem}_out{ending}")
    output = mesh_output(given, str(path), str(out), 256, 1)
    unwrap_mesh(given.mesh, Request(Unwrap(), BORDER, SEED), output)
    turned = evaluate(*read_parameterized(out))["mirrored_area_fraction"]
    return turned == 0 and _faces_up(out, faces, area)


FAMILIES: dict[str, Callable[[], Iterator[Case]]] = {
    "split vertices": split_vertices,
    "strays": wild_clouds.strays,
    "polygons": polygons,
    "glTF": gltf,
    "writers": writers,
    "commas": commas,
    "spellings": spellings,
    "STL": stl,
    "marks": marks,
    "scan lines": wild_clouds.scan_lines,
    "PCD": wild_clouds.pcd,
    "LAS": wild_clouds.las,
    "written": written,
}
"""What makes the files of each family."""


@click.command()
def main() -> None:
    """Read files as other tools write them, and exit with 1 if one is wrong."""
    logging.basicConfig(level=logging.ERROR, format="%(message)s")
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for family, cases in FAMILIES.items():
            made = list(cases())
            found = tally(made, Path(folder))
            faults += len(found.wrong)
            print(
                f"{family}: {len(made)} files, {found.read} read, {found.refused} refused "
                f"({found.refused / len(made):.0%}), wrong: {', '.join(found.wrong) or 'none'}"
            )
    if faults:
        sys.exit(1)


if __name__ == "__main__":
    console.run(main)
