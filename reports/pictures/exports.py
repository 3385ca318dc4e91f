"""Textured exports: every map on its mesh as OBJ + MTL + PNG and as GLB, for other programs."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
from PIL import Image

from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.files.targets import complete_file, write_text
from parapoint.files.writing.mesh_writers import write_obj
from parapoint.sources import source_hash
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from parapoint.textures.checkerboard import checkerboard
from reports.contents import Contents
from reports.pictures.drawing import known_keys
from reports.pictures.names import slug
from reports.progress import QUIET, Progress

KINDS = ("obj", "glb")


def _stem(report: Path, row: ResultRow) -> Path:
    name = f"{slug(row.method)}.{row.id[:8]}"
    return report / "exports" / slug(row.suite) / slug(row.case) / name


def written(report: Path, row: ResultRow) -> dict[str, str]:
    """Addresses of the exports of a cell that lie in the report, by their names."""
    stem = _stem(report, row)
    paths = {kind.upper(): stem.with_name(f"{stem.name}.{kind}") for kind in KINDS}
    return {
        name: path.relative_to(report).as_posix() for name, path in paths.items() if path.exists()
    }


def write(contents: Contents, report: Path, progress: Progress = QUIET) -> list[str]:
    """Write the exports of the suite that are not there yet; what could not be, and why."""
    record = report / "exports" / slug(contents.suite) / "keys.json"
    record.parent.mkdir(parents=True, exist_ok=True)
    known = known_keys(record)
    source = source_hash(__name__)
    keys, faults = {}, []
    rows = progress.track(contents.rows, f"{contents.suite}: exports", len(contents.rows))
    for row in rows:
        if row.status != "ok":
            continue
        text = f"{source} {row.surface_hash} {row.uv_sha256}"
        key = hashlib.sha256(text.encode()).hexdigest()[:16]
        if known.get(row.id) != key or len(written(report, row)) < len(KINDS):
            try:
                surface, result = contents.store.surface(row), contents.store.result(row)
                if not isinstance(surface, Mesh) or not isinstance(result, Parameterization):
                    continue  # a cloud has no faces for a texture
                textured(_stem(report, row), surface, result)
            except InputError as error:
                faults.append(f"{row.case}, {row.method}: no export: {error}")
                continue
        keys[row.id] = key
    write_text(record, json.dumps(keys, indent=0, sort_keys=True) + "\n")
    return faults


def textured(stem: Path, mesh: Mesh, parameterization: Parameterization) -> None:
    """Write `stem`.obj (with .mtl and .png) and `stem`.glb: the mesh under a checkerboard.

    The map is as it was measured, moved and scaled into the unit square, so that the same board
    fits all methods. Corners that it leaves out lie in a corner of the square.

    Raises:
        InputError: the map is not one of this mesh, or covers none of it.
    """
    stem.parent.mkdir(parents=True, exist_ok=True)
    uv, covered = parameterization.uv, parameterization.covered
    if not covered.any():
        raise InputError("the map covers no face: every uv is NaN")
    used = uv[np.unique(parameterization.corners[covered])]
    side = float(np.ptp(used, axis=0).max()) or 1.0
    known = np.nan_to_num((uv - used.min(axis=0)) / side)
    fitted = Parameterization(known, parameterization.corners)
    texture = checkerboard()
    write_obj(stem.with_name(f"{stem.name}.obj"), mesh, fitted, texture)
    with complete_file(stem.with_name(f"{stem.name}.glb")) as file:
        file.write(glb(mesh, fitted, texture))


def glb(mesh: Mesh, parameterization: Parameterization, texture: npt.NDArray[np.uint8]) -> bytes:
    """A binary glTF file of the mesh, its vertices split where the map is cut."""
    pairs, corners = np.unique(
        np.stack([mesh.faces.reshape(-1), parameterization.corners.reshape(-1)], axis=1),
        axis=0,
        return_inverse=True,
    )
    made: Any = trimesh.visual  # which has no types
    material = made.material.PBRMaterial(
        baseColorTexture=Image.fromarray(texture),
        metallicFactor=0.0,
        roughnessFactor=0.9,
        doubleSided=True,
    )
    visual = made.TextureVisuals(parameterization.uv[pairs[:, 1]], material=material)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = low + (high - low) / 2  # glTF has single precision: the node carries it to its place
    shape = trimesh.Trimesh(
        mesh.vertices[pairs[:, 0]] - middle, corners.reshape(-1, 3), visual=visual, process=False
    )
    place = np.eye(4)
    place[:3, 3] = middle
    scene: Any = trimesh.Scene()
    scene.add_geometry(shape, transform=place)
    content = scene.export(file_type="glb")
    assert isinstance(content, bytes)
    return content
