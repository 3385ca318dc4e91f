"""MeshLab's parameterizations, through pymeshlab."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from baselines.tools.atlas import joined_corners, row_numbers
from baselines.tools.optional import optional
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError, check_triangles, domain, scaled
from parapoint.surfaces.frame import in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

pymeshlab = optional(
    "pymeshlab", "pip install pymeshlab, and the system library libGL.so.1 (Debian: libgl1)"
)


failed: list[Any] = []
"""Mesh sets of which a filter failed. They are never destroyed, as pymeshlab then damages memory of
the process: whatever reads texture coordinates later crashes (seen in 2025.7)."""


def filtered(vertices: FloatArray, faces: IntArray, name: str, **options: object) -> Any:
    """The MeshSet of these vertices and faces after a filter that makes texture coordinates.

    Arrays read from it die with it.

    Raises:
        UnsupportedError: pymeshlab is not installed.
        FlatteningError: the filter failed; its message.
    """
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    try:
        meshes.apply_filter(name, **options)
    except pymeshlab.PyMeshLabException as error:
        failed.append(meshes)
        raise FlatteningError(" ".join(str(error).split())) from None
    return meshes


@dataclass(frozen=True)
class MeshLabLSCM:
    """MeshLab's least-squares conformal map."""

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area; raises as `disk_map`."""
        return disk_map(surface, "compute_texcoord_parametrization_least_squares_conformal_maps")


@dataclass(frozen=True)
class MeshLabHarmonic:
    """MeshLab's harmonic map, the boundary on a circle."""

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area; raises as `disk_map`."""
        return disk_map(surface, "compute_texcoord_parametrization_harmonic")


def disk_map(surface: Surface, name: str) -> Parameterization:
    """The map of a filter that gives one uv a vertex.

    Raises:
        UnsupportedError: the surface is no disk, with or without holes; pymeshlab is missing.
        InputError: a triangle has no area.
        FlatteningError: the filter failed.
    """
    disk = domain(surface)
    check_triangles(disk.vertices, disk.faces)
    made = filtered(in_unit(disk.vertices, disk.faces), disk.faces, name)
    return Parameterization(scaled(disk, made.current_mesh().vertex_tex_coord_matrix()), disk.faces)


@dataclass(frozen=True)
class MeshLabVoronoi:
    """MeshLab's Voronoi atlas: geodesic Voronoi cells, each mapped harmonically.

    The filter draws its cells from a generator that cannot be seeded: a fresh process, as each cell
    of a run is, repeats a map, a second call in one process does not. It does not end where there
    are hardly more vertices than cells, or neighbouring faces turn differently.

    Attributes:
        regions: number of cells to begin with, in each component.
    """

    regions: int = 10

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "oriented", "connected"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (the filter takes no seed)
        """The atlas in the unit square.

        Raises:
            UnsupportedError: the surface is a point cloud or has less than two vertices a region;
                pymeshlab is missing.
            FlatteningError: the filter failed, or left faces out.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        if len(surface.vertices) < 2 * self.regions:
            raise UnsupportedError(
                f"needs at least {2 * self.regions} vertices for {self.regions} regions; "
                f"there are {len(surface.vertices)}"
            )
        unit = Mesh(in_unit(surface.vertices, surface.faces), surface.faces)
        made = filtered(
            unit.vertices,
            unit.faces,
            "generate_voronoi_atlas_parametrization",
            regionnum=self.regions,
        )
        atlas = made.mesh(len(made) - 1)  # this filter makes a new mesh
        face, turn = matched_faces(unit, atlas.vertex_matrix(), atlas.face_matrix())
        uv = atlas.wedge_tex_coord_matrix().reshape(-1, 3, 2)[face]
        uv = uv[np.arange(len(uv))[:, None], (np.arange(3) + turn[:, None]) % 3]
        return joined_corners(surface, uv)


@dataclass(frozen=True)
class MeshLabTriangles:
    """MeshLab's trivial per-triangle map: every face a chart, packed by size.

    Attributes:
        border: texels between triangles, of a page of `page_size`.
        page_size: side of the page in texels.
    """

    border: int = 2
    page_size: int = 1024

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The atlas in the unit square, no two corners joined.

        Raises:
            UnsupportedError: the surface is a point cloud; pymeshlab is missing.
            FlatteningError: the filter failed: the page is too small for the faces.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        made = filtered(
            in_unit(surface.vertices, surface.faces),
            surface.faces,
            "compute_texcoord_parametrization_triangle_trivial_per_wedge",
            textdim=self.page_size,
            border=self.border,
        )
        uv = made.current_mesh().wedge_tex_coord_matrix()
        return Parameterization(uv, np.arange(len(uv)).reshape(-1, 3))


def matched_faces(mesh: Mesh, vertices: FloatArray, faces: IntArray) -> tuple[IntArray, IntArray]:
    """(F,) row of `faces` for each face of the mesh; (F,) which corner there is its corner 0.

    The Voronoi atlas rounds positions to float32, merges equal vertices, repeats faces and returns
    them in an order of its own.

    Args:
        mesh: what went in.
        vertices: (V, 3) positions that came out.
        faces: (M, 3) faces that came out, rows of `vertices`.

    Raises:
        FlatteningError: a face of the mesh is not among them.
    """
    x, y, z = np.concatenate([mesh.vertices, vertices]).astype(np.float32).T
    place = row_numbers(x, y, z)
    corners = place[np.concatenate([mesh.faces, faces + len(mesh.vertices)])]
    first = corners.argmin(axis=1)
    turned = np.take_along_axis(corners, (np.arange(3) + first[:, None]) % 3, axis=1)
    triple = row_numbers(*turned.T)
    count = len(mesh.faces)
    row = np.full(int(triple.max()) + 1, -1)
    row[triple[count:][::-1]] = np.arange(len(faces))[::-1]  # of repeated ones the first
    face = row[triple[:count]]
    if (lost := int((face < 0).sum())) > 0:
        raise FlatteningError(f"MeshLab's atlas left out {lost} of {count} faces")
    return face, (first[count:][face] - first[:count]) % 3
