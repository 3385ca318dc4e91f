"""Small suites that have something of everything.

Maps are sheared by powers of two, so that areas which are equal are equal on every machine.
"""

from pathlib import Path

import numpy as np

from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud
from reports.contents import Contents, contents

from .conftest import DEVIL, HAND, NEFERTITI, Writer, ball, flat, lonlat, sheet


def varied(folder: Path) -> Contents:
    """Disks, a sphere and a cloud; one chart and many; seeds that fail; busy hours."""
    writer = Writer(folder)
    mesh, cloud = sheet(), PointCloud(sheet(13).vertices)
    torn = Parameterization(
        mesh.vertices[mesh.faces][:, :, :2].reshape(-1, 2)
        + 3 * np.repeat(np.arange(128), 3)[:, None],
        np.arange(384).reshape(-1, 3),
    )
    folded = flat(mesh)
    folded = Parameterization(np.abs(folded.uv - [[0.3, 0]]), folded.corners)
    with writer.store.writing():
        writer.store.add_run(
            {"commit": "89abcdef0123", "cpu": "One", "cores": 4, "dirty": True, "python": "3.11"}
        )
        writer.store.add_run({"commit": "fedcba987654", "cpu": "Two", "cores": 8, "python": "3.12"})
        for number, case in enumerate((HAND, DEVIL, "beetle", "bimba", "spot")):
            for seed in (0, 1):
                writer.cell(case, mesh, "lscm", {}, seed=seed, result=flat(mesh), load=0.7)
                result = (
                    folded if number == 2 else flat(mesh, 0.125 + 0.125 * seed + 0.0625 * number)
                )
                took = {
                    "seconds": 1.5 + number,
                    "cpu_seconds": 2.5 + number,
                    "load": 1.0 + number / 2,
                }
                writer.cell(case, mesh, "parapoint", {}, seed=seed, result=result, run=1, **took)
            writer.cell(case, mesh, "xatlas", {}, result=torn, peak_memory_mb=120.0 + number)
            status = {"status": "failed", "reason": "no start without flips"}
            writer.cell(case, mesh, "slim", {}, result=flat(mesh, 0.25)) if number else writer.cell(
                case, mesh, "slim", {}, **status
            )
        writer.cell("spot", mesh, "slim", {}, seed=1, status="timeout", reason="over 10 s")
        round_mesh = ball()
        cut = {"preprocessing": "automatic cut to a disk"}
        writer.cell(NEFERTITI, round_mesh, "lscm", {}, result=lonlat(round_mesh), **cut)
        writer.cell(NEFERTITI, round_mesh, "parapoint", {}, result=lonlat(round_mesh), run=1)
        for seed, bend in ((0, 0.1), (1, 0.4)):
            x, y, _ = cloud.points.T
            uv = np.stack([x + bend * y, y], axis=1)
            writer.cell(
                "a cloud", cloud, "parapoint", {}, seed=seed, result=PointParameterization(uv)
            )
        writer.cell("a cloud", cloud, "lscm", {}, status="skipped", reason="needs faces")
    return contents(folder)[0]


def ablation(folder: Path) -> Contents:
    """Variants of one method on two models, one of them with fewer seeds."""
    writer = Writer(folder)
    mesh = sheet()
    with writer.store.writing():
        for case in (HAND, DEVIL):
            for number, params in enumerate(({}, {"unwrap_weight": 0.0}, {"cycle_weight": 0.0})):
                for seed in range(2 if number else 1):
                    result = flat(mesh, 0.125 * (number + seed))
                    writer.cell(case, mesh, "parapoint", params, seed=seed, result=result)
        writer.cell(
            DEVIL, mesh, "parapoint", {"start": "none"}, status="out_of_memory", reason="over 2 GB"
        )
    return contents(folder)[0]


def baked(folder: Path) -> Contents:
    """Textures of one cloud by two pipelines, one with two seeds."""
    writer = Writer(folder)
    cloud = PointCloud(sheet(13).vertices)
    with writer.store.writing():
        for pipeline, seed, psnr in (
            ("computed", 0, 31.04),
            ("computed", 1, 33.0),
            ("poisson", 0, 28),
        ):
            report = {"bake_psnr": psnr, "bake_cpu_seconds": 1.25 + seed, "charts": 3 + seed}
            result = PointParameterization(cloud.points[:, :2])
            params = {"pipeline": pipeline}
            writer.cell("wavy", cloud, "textured", params, seed=seed, result=result, report=report)
    return contents(folder)[0]
