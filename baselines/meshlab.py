"""MeshLab's parameterizations, through pymeshlab."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.atlas import joined_corners
from baselines.flattening import FlatteningError, check_triangles, domain, scaled
from baselines.optional import optional
from parapoint.method import UnsupportedError
from parapoint.parameterization import Parameterization
from parapoint.surface import FloatArray, IntArray, Mesh, Surface

pymeshlab = optional(
    "pymeshlab", "pip install pymeshlab, and the system library libGL.so.1 (Debian: libgl1)"
)


class Filtered(NamedTuple):
    """A mesh after a filter.

    Attributes:
        triangles: (M, 3, 3) corner positions of each face.
        uv: (V, 2), one a vertex, or (3M, 2), one a corner; as the filter makes them.
    """

    triangles: FloatArray
    uv: FloatArray


def filtered(vertices: FloatArray, faces: IntArray, name: str, **options: object) -> Filtered:
    """The mesh of these vertices and faces after a filter that makes texture coordinates.

    Raises:
        UnsupportedError: pymeshlab is not installed.
        FlatteningError: the filter failed; its message.
    """
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    try:
        meshes.apply_filter(name, **options)
    except pymeshlab.PyMeshLabException as error:
        raise FlatteningError(" ".join(str(error).split())) from None
    made = meshes.mesh(len(meshes) - 1)  # a filter that makes a new mesh appends it
    by_vertex = made.has_vertex_tex_coord()
    uv = made.vertex_tex_coord_matrix() if by_vertex else made.wedge_tex_coord_matrix()
    # Copies: the arrays die with the MeshSet.
    return Filtered(made.vertex_matrix()[made.face_matrix()], np.array(uv))


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
    uv = filtered(disk.vertices, disk.faces, name).uv
    return Parameterization(scaled(disk, uv), disk.faces)


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
        made = filtered(
            surface.vertices,
            surface.faces,
            "generate_voronoi_atlas_parametrization",
            regionnum=self.regions,
        )
        face, turn = matched_faces(surface, made.triangles)
        uv = made.uv.reshape(-1, 3, 2)[face]
        uv = np.take_along_axis(uv, ((np.arange(3) + turn[:, None]) % 3)[:, :, None], axis=1)
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
            surface.vertices,
            surface.faces,
            "compute_texcoord_parametrization_triangle_trivial_per_wedge",
            textdim=self.page_size,
            border=self.border,
        )
        return Parameterization(made.uv, np.arange(len(made.uv)).reshape(-1, 3))


def matched_faces(mesh: Mesh, triangles: FloatArray) -> tuple[IntArray, IntArray]:
    """(F,) row of `triangles` for each face of the mesh; (F,) which corner there is its corner 0.

    The Voronoi atlas rounds positions to float32, merges equal vertices, repeats faces and returns
    them in an order of its own.

    Args:
        mesh: what went in.
        triangles: (M, 3, 3) corner positions that came out.

    Raises:
        FlatteningError: a face of the mesh is not among them.
    """
    both = np.concatenate([mesh.vertices[mesh.faces], triangles]).astype(np.float32)
    _, point = np.unique(both.reshape(-1, 3), axis=0, return_inverse=True)
    point = point.reshape(-1, 3)
    first = point.argmin(axis=1)
    turned = np.take_along_axis(point, (np.arange(3) + first[:, None]) % 3, axis=1)
    _, triple = np.unique(turned, axis=0, return_inverse=True)
    count = len(mesh.faces)
    wanted, came = triple.reshape(-1)[:count], triple.reshape(-1)[count:]
    known, row = np.unique(came, return_index=True)
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    lost = known[place] != wanted
    if lost.any():
        raise FlatteningError(f"MeshLab's atlas left out {int(lost.sum())} of {count} faces")
    face = row[place]
    return face, (first[count:][face] - first[:count]) % 3
