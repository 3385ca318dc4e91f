"""Part of `python -m benchmarks speed`: what a method costs on top of the library that it calls.

Each method is timed as a run times it, after the surface is read and prepared and the library is
imported. It is compared with a bare call of its library on the same arrays, without checks, initial
map, trace or scaling. All times are processor time, which other programs disturb less than wall
time. Two methods have no bare call to compare with: Blender runs in a process of its own, and BFF
is our own code.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import igl
import numpy as np
from rich.table import Table
from scipy import sparse

from baselines import registry
from benchmarks.commands.metric_speed import speed_map
from parapoint.method import Method, MissingError
from parapoint.planar.scaffold import LARGE
from parapoint.surfaces.frame import in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh

SIZES = (10_000, 100_000)
"""Numbers of faces of the disks."""
MOST_TIMES = 20
"""How often a method is measured at most."""
ENOUGH = 10.0
"""Processor time in seconds after which a method is not measured again."""
LIMIT = 0.1
"""Time that a method may add to its library's, as a fraction of the library's."""

Call = Callable[[], object]
Bare = Callable[[Mesh, Parameterization], Call]
"""Makes the bare call of a library from a mesh and the map that the method made of it."""


class Overhead(NamedTuple):
    """One method on one disk.

    Attributes:
        method: its spec.
        faces: number of faces.
        bare: processor time of the library alone, in seconds.
        whole: processor time of the method, in seconds.
        fault: why there are no times; "" if there are.
    """

    method: str
    faces: int
    bare: float
    whole: float
    fault: str = ""


def bare_tutte(mesh: Mesh, made: Parameterization) -> Call:
    """The graph's Laplacian, solved with the boundary where the method puts it."""
    loop, inside = mesh.boundary_loops[0], np.zeros((len(mesh.vertices), 2))

    def call() -> None:
        adjacency = igl.adjacency_matrix(mesh.faces).astype(np.float64)
        laplacian = sparse.diags(adjacency.sum(axis=1).A1) - adjacency
        igl.min_quad_with_fixed(laplacian.tocsc(), inside, loop, made.uv[loop])

    return call


def bare_harmonic(mesh: Mesh, made: Parameterization) -> Call:
    """The harmonic map with the boundary where the method puts it."""
    loop = mesh.boundary_loops[0]
    return lambda: igl.harmonic(mesh.vertices, mesh.faces, loop, made.uv[loop], 1)


def bare_lscm(mesh: Mesh, made: Parameterization) -> Call:
    """LSCM, pinned where the method pins it: the two vertices that lie on the u axis."""
    pins = np.flatnonzero(made.uv[:, 1] == 0)
    pins = pins[np.argsort(made.uv[pins, 0])]
    return lambda: igl.lscm(mesh.vertices, mesh.faces, pins, np.array([[0.0, 0], [1, 0]]))


def bare_arap(mesh: Mesh, _: Parameterization) -> Call:
    """A hundred steps of ARAP from Tutte's embedding."""
    embedded = registry.method("tutte")[1].parameterize(mesh, seed=0)
    assert isinstance(embedded, Parameterization)
    held, start = mesh.boundary_loops[0][:1], embedded.uv

    def call() -> None:
        solver = igl.ARAPData()
        igl.arap_precomputation(mesh.vertices, mesh.faces, 2, held.astype(np.int32), solver)
        solver.max_iter = 100
        igl.arap_solve(start[held], solver, start)

    return call


def bare_slim(mesh: Mesh, made: Parameterization) -> Call:
    """Twenty steps of SLIM from the start of the method, on a map of the same side."""
    scale = LARGE / (float(igl.doublearea(mesh.vertices, mesh.faces).sum()) / 2) ** 0.5
    vertices, start = scale * mesh.vertices, scale * np.asarray(made.trace[0].uv)

    def call() -> None:
        solver = igl.slim_precompute(
            np.asfortranarray(vertices),
            np.asfortranarray(mesh.faces.astype(np.int32)),
            np.asfortranarray(start),
            igl.MappingEnergyType.SYMMETRIC_DIRICHLET,
            np.zeros(0, dtype=np.int32),
            np.zeros((0, 2), order="F"),
            0.0,
        )
        igl.slim_solve(solver, 20)

    return call


def bare_xatlas(mesh: Mesh, _: Parameterization) -> Call:
    """Charts and packing with the library's own options."""
    import xatlas

    def call() -> None:
        atlas = xatlas.Atlas()
        atlas.add_mesh(
            in_unit(mesh.vertices, mesh.faces).astype(np.float32), mesh.faces.astype(np.uint32)
        )
        atlas.generate()
        atlas.get_mesh(0)

    return call


def bare_uvatlas(mesh: Mesh, _: Parameterization) -> Call:
    """Open3D's UVAtlas with the method's options."""
    import open3d

    def call() -> None:
        made = open3d.t.geometry.TriangleMesh(
            open3d.core.Tensor.from_numpy(in_unit(mesh.vertices, mesh.faces).astype(np.float32)),
            open3d.core.Tensor.from_numpy(mesh.faces.copy()),
        )
        made.compute_uvatlas(size=512, gutter=1.0, max_stretch=1 / 6, nthreads=1)
        made.triangle.texture_uvs.numpy()

    return call


def bare_uvunwrap(mesh: Mesh, _: Parameterization) -> Call:
    """Charts and packing with the library's own options."""
    import uvunwrap

    def call() -> None:
        made = uvunwrap.generate(
            [uvunwrap.Mesh(in_unit(mesh.vertices, mesh.faces), mesh.faces.astype(np.uint32))]
        )
        np.array(made.meshes[0].uv)

    return call


def bare_meshlab(name: str, **options: object) -> Bare:
    """One of MeshLab's filters, its mesh read back."""

    def bare(mesh: Mesh, _: Parameterization) -> Call:
        import pymeshlab

        def call() -> None:
            meshes = pymeshlab.MeshSet(verbose=False)
            meshes.add_mesh(pymeshlab.Mesh(in_unit(mesh.vertices, mesh.faces), mesh.faces))
            meshes.apply_filter(name, **options)
            made = meshes.mesh(len(meshes) - 1)
            made.vertex_matrix(), made.face_matrix()
            if made.has_vertex_tex_coord():
                made.vertex_tex_coord_matrix()
            else:
                made.wedge_tex_coord_matrix()

        return call

    return bare


BARE: dict[str, Bare] = {
    "tutte": bare_tutte,
    "harmonic": bare_harmonic,
    "lscm": bare_lscm,
    "arap": bare_arap,
    "slim": bare_slim,
    "xatlas": bare_xatlas,
    "uvatlas": bare_uvatlas,
    "uvunwrap": bare_uvunwrap,
    "meshlab_lscm": bare_meshlab("compute_texcoord_parametrization_least_squares_conformal_maps"),
    "meshlab_harmonic": bare_meshlab("compute_texcoord_parametrization_harmonic"),
    "meshlab_voronoi": bare_meshlab("generate_voronoi_atlas_parametrization", regionnum=10),
    "meshlab_triangles": bare_meshlab(
        "compute_texcoord_parametrization_triangle_trivial_per_wedge", textdim=1024, border=2
    ),
}
"""The library's part of each method that calls one in its own process."""


def overheads(sizes: tuple[int, ...] = SIZES) -> list[Overhead]:
    """Each method on a disk of each size: the least of 20 times, or of as many as take 10 s."""
    found = []
    for faces in sizes:
        disk, _ = speed_map("disk", faces)
        for spec, bare in BARE.items():
            _, method = registry.method(spec)
            times: list[tuple[float, float]] = []
            try:
                while len(times) < MOST_TIMES and np.sum(times) < ENOUGH:
                    times.append(_times(method, bare, Mesh(disk.vertices, disk.faces)))
                library, whole = (float(least) for least in np.min(times, axis=0))
                found.append(Overhead(spec, len(disk.faces), library, whole))
            except (MissingError, RuntimeError) as error:
                found.append(Overhead(spec, len(disk.faces), np.nan, np.nan, str(error)))
    return found


def _times(method: Method, bare: Bare, mesh: Mesh) -> tuple[float, float]:
    """Processor seconds of the bare call and of the method on a mesh not looked at before."""
    (surface,) = prepared(mesh, method.requires).parts
    begin = time.process_time()
    made = method.parameterize(surface, seed=0)
    whole = time.process_time() - begin
    assert isinstance(made, Parameterization)
    call = bare(mesh, made)
    begin = time.process_time()
    call()
    return time.process_time() - begin, whole


def overhead_table(costs: list[Overhead]) -> Table:
    """The costs as a table."""
    shown = Table(title="Methods and bare calls of their libraries", title_justify="left")
    shown.add_column("method")
    for heading in ("faces", "CPU seconds", "library alone", "more", "limit"):
        shown.add_column(heading, justify="right")
    for cost in costs:
        seconds = (
            [cost.fault, "", ""]
            if cost.fault
            else [f"{cost.whole:.4f}", f"{cost.bare:.4f}", f"{cost.whole / cost.bare - 1:+.1%}"]
        )
        shown.add_row(cost.method, f"{cost.faces:,}", *seconds, f"{LIMIT:.0%}")
    return shown
