"""A small results folder with everything that a report must be able to show."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import igl
import numpy as np
import pytest

from benchmarks.rendering import scene
from benchmarks.store.archives import arrays_hash, map_arrays, trace_arrays, write_arrays
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow, identity
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import Mesh
from reports.contents import contents
from reports.pictures import clouds, style
from reports.pictures import drawing as pictures
from reports.report import write

HAND, DEVIL, NEFERTITI = "hand_1_i_f5000", "mannequin-devil", "nefertiti-lowres_odedstein"
"""Names of the registry with published figures: likely, stand-in, likely."""

HOSTILE = "<script>alert('&_%$#{}')</script>"


def sheet(count: int = 9) -> Mesh:
    """A wavy square sheet, a disk."""
    vertices, faces = igl.triangulated_grid(count, count)
    x, y = vertices.T
    points = np.stack([x, y, 0.15 * np.sin(5 * x) * np.cos(4 * y)], axis=1)
    return Mesh(points, faces)


def ball() -> Mesh:
    """An icosahedron, split twice, on the unit sphere."""
    vertices, faces = igl.icosahedron()
    vertices, faces = igl.upsample(vertices, faces, 2)
    return Mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces)


def flat(mesh: Mesh, bend: float = 0.0) -> Parameterization:
    """The map that drops z, sheared by `bend`, with a trace of three maps."""
    x, y, _ = mesh.vertices.T
    steps = [np.stack([x + b * y, y], axis=1) for b in (bend + 1, bend + 0.5, bend)]
    trace = tuple(
        TracePoint(10 * k, 0.1 + k, {"total": 1.0 / (k + 1), "cycle": 0.5 / (k + 1)}, uv)
        for k, uv in enumerate(steps)
    )
    return Parameterization(steps[-1], mesh.faces, trace)


def lonlat(mesh: Mesh) -> Parameterization:
    """Longitude and latitude by vertex: faces across the date line span the seam."""
    x, y, z = mesh.vertices.T
    return Parameterization(np.stack([np.arctan2(y, x), np.arcsin(z)], axis=1), mesh.faces)


class Writer:
    """Writes cells into a store."""

    def __init__(self, folder: Path) -> None:
        self.store = Store(folder)

    def cell(self, case, surface, method, params, *, result=None, seed=0, **given) -> ResultRow:
        name = self.store.add_surface(surface) if surface is not None else ""
        key = identity(
            suite="paper",
            case=case,
            method=method,
            params=params,
            seed=seed,
            source_hash="abc",
            surface_hash=name,
        )
        row = ResultRow(key, "paper", case, method, params, seed, "abc", name, "ok", seconds=0.25)
        if result is not None:
            arrays = map_arrays(result)
            path = self.store.uv_path(key)
            write_arrays(path, arrays | trace_arrays(result.trace))
            given |= {"uv_file": f"uv/{key}.npz", "uv_sha256": arrays_hash(arrays)}
        row = dataclasses.replace(row, **given)
        self.store.append(row)
        return row


def draw_small(patch: pytest.MonkeyPatch) -> None:
    """Small pictures, few rays and few points."""
    patch.setattr(clouds, "SPARSE", 400)
    patch.setattr(clouds, "DENSE", 4000)
    patch.setattr(pictures, "SIZE", 48)
    patch.setattr(scene, "OCCLUSION_RAYS", 0)
    patch.setattr(scene, "FINE_FACES", 0)
    patch.setitem(style.STYLE, "savefig.dpi", 40)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_small(monkeypatch)


@pytest.fixture(scope="session")
def reported(results: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the results, under a name that needs escaping, with its report."""
    folder = tmp_path_factory.mktemp("reported") / "r <b>&'"
    shutil.copytree(results, folder)
    with pytest.MonkeyPatch.context() as patch:
        draw_small(patch)
        write(folder, jobs=1)
    return folder


SLIM = {"energy": "symmetric_dirichlet", "iterations": 20}


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three models; SLIM twice, ParaPoint with a learned seam, a skip, a time-out, hostile text."""
    folder = tmp_path_factory.mktemp("results")
    writer = Writer(folder)
    with writer.store.writing():
        writer.store.add_run({"commit": "0123456789abcdef", "cpu": "A & B_1", "cores": 2})
        for case in (HAND, DEVIL):
            mesh = sheet()
            writer.cell(case, mesh, "slim", SLIM, result=flat(mesh, 0.3))
            writer.cell(
                case, mesh, "slim", {"energy": "conformal", "iterations": 20}, result=flat(mesh)
            )
            writer.cell(case, mesh, "parapoint", {"preset": "paper"}, result=flat(mesh, 0.1))
        mesh = ball()
        writer.cell(
            NEFERTITI, mesh, "slim", SLIM, status="skipped", reason=f"needs a disk {HOSTILE}"
        )
        writer.cell(
            NEFERTITI,
            mesh,
            "parapoint",
            {"preset": "paper"},
            result=lonlat(mesh),
            preprocessing="automatic cut to a disk",
        )
        writer.cell(
            NEFERTITI, mesh, HOSTILE, {"x": HOSTILE}, status="timeout", reason="over 10 s", seed=3
        )
    return folder


def seeded(folder, cases=(HAND,), seeds=(0, 1, 2)):
    """LSCM, the same for all seeds, and ParaPoint, whose map is worse by seed and by model."""
    writer = Writer(folder)
    mesh = sheet()
    with writer.store.writing():
        for number, case in enumerate(cases):
            for seed in seeds:
                bend = 0.1 + 0.1 * seed + 0.05 * number
                writer.cell(case, mesh, "lscm", {}, seed=seed, result=flat(mesh))
                writer.cell(case, mesh, "parapoint", {}, seed=seed, result=flat(mesh, bend))
    return contents(folder)[0]
