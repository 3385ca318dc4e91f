"""What a user with a scan would do instead: mesh it, flatten the mesh, carry the map back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import igl
import numpy as np
from scipy.spatial import cKDTree

from baselines.disks.lscm import LSCM
from baselines.disks.slim import SLIM
from baselines.tools.meshlab import failed, pymeshlab
from baselines.tools.xatlas_charts import Xatlas
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Charted, Parameterization, PointParameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud, Surface

FLATTENINGS: dict[str, Xatlas | LSCM | SLIM] = {"xatlas": Xatlas(), "lscm": LSCM(), "slim": SLIM()}

REACH = 4.0
"""The surface is kept this near to the cloud, in distances between neighbouring points."""
NEIGHBOURS = 6
"""Neighbours whose mean distance is the spacing of a cloud at a point."""
CLEANING: tuple[tuple[str, dict[str, object]], ...] = (
    ("meshing_remove_duplicate_faces", {}),
    ("meshing_remove_null_faces", {}),
    ("meshing_repair_non_manifold_edges", {"method": "Remove Faces"}),
    ("meshing_repair_non_manifold_vertices", {}),
    ("meshing_re_orient_faces_coherently", {}),
    ("meshing_close_holes", {"maxholesize": 30}),
    ("meshing_remove_null_faces", {}),
    ("meshing_repair_non_manifold_vertices", {}),  # that the lids have made
    ("meshing_remove_connected_component_by_face_number", {"mincomponentsize": 25}),
    ("meshing_remove_unreferenced_vertices", {}),
)
"""MeshLab's filters in the order of a clean-up; the numbers are its own."""


@dataclass(frozen=True)
class Meshed:
    """A cloud meshed in MeshLab, the mesh flattened, the map carried back to the points.

    Normals are the cloud's or, without any, MeshLab's estimate. The reconstruction is either

    - screened Poisson (M. Kazhdan and H. Hoppe 2013), cut back to where points are, as it closes
      every surface up;
    - or ball pivoting (F. Bernardini et al. 1999), the ball as MeshLab guesses it.

    It is cleaned as a user would do it, all by MeshLab: faces at edges with more than two removed,
    vertices of several fans split, faces turned alike, small holes filled, small components
    dropped. What the flattening needs beyond (disks, one component at a time) is prepared as for
    any mesh of the benchmark. A point gets the
    uv of the nearest place on the mesh, by barycentric coordinates. The report counts all of it.

    Attributes:
        reconstruction: how the cloud is meshed.
        flattening: how the mesh is mapped; with its own default parameters.
    """

    reconstruction: Literal["poisson", "ball_pivoting"] = "poisson"
    flattening: Literal["xatlas", "lscm", "slim"] = "slim"

    requires: ClassVar[frozenset[str]] = frozenset({"points"})
    packages: ClassVar[tuple[str, ...]] = ("pymeshlab", "libigl", "xatlas", "scipy")

    def parameterize(self, surface: Surface, *, seed: int) -> PointParameterization:
        """The map of a cloud.

        Raises:
            UnsupportedError: the surface is a mesh; pymeshlab or xatlas is not installed.
            FlatteningError: the reconstruction gave no surface, or a component could not be mapped.
        """
        if not isinstance(surface, PointCloud):
            raise UnsupportedError("takes a point cloud; the surface is a mesh")
        (mesh, flat), report = self._charted(surface, seed)
        uv, distance = carried(surface.points, mesh, flat)
        facts = {
            "charts": int(flat.charts().max()) + 1,
            "seam_edges": len(flat.seams(mesh)),
            "mean_distance_to_mesh": float(distance.mean()),
            "largest_distance_to_mesh": float(distance.max()),
        }
        return PointParameterization(uv, report=report | facts)

    def charted(self, surface: PointCloud, *, seed: int) -> Charted:
        """The mesh of a cloud and its map, as `parameterize` makes them.

        Raises:
            UnsupportedError, FlatteningError: see `parameterize`.
        """
        return self._charted(surface, seed)[0]

    def _charted(self, surface: PointCloud, seed: int) -> tuple[Charted, dict[str, object]]:
        mesh, report = reconstructed(surface, self.reconstruction)
        method = FLATTENINGS[self.flattening]

        try:
            ready = prepared(mesh, method.requires)
            flat = ready.joined(ready.maps(method, seed))
        except (InputError, UnsupportedError) as error:  # of the mesh made here, not of the cloud
            raise FlatteningError(f"the reconstruction cannot be flattened: {error}") from None
        assert isinstance(flat, Parameterization)
        return Charted(mesh, flat), report


def reconstructed(cloud: PointCloud, kind: str) -> tuple[Mesh, dict[str, object]]:
    """The mesh of a cloud, cleaned, and what was done to it.

    Raises:
        UnsupportedError: pymeshlab is not installed.
        FlatteningError: no surface is left.
    """
    centre = (cloud.points.max(axis=0) + cloud.points.min(axis=0)) / 2
    radius = float(np.linalg.norm(cloud.points - centre, axis=1).max()) or 1.0
    points = (cloud.points - centre) / radius
    meshes = pymeshlab.MeshSet(verbose=False)
    try:
        if cloud.normals is None:
            meshes.add_mesh(pymeshlab.Mesh(points))
            meshes.compute_normal_for_point_clouds()
        else:
            meshes.add_mesh(pymeshlab.Mesh(points, v_normals_matrix=cloud.normals))
        if kind == "poisson":
            # One thread: with more the surface is another one at each run.
            meshes.generate_surface_reconstruction_screened_poisson(threads=1)
        else:
            meshes.generate_surface_reconstruction_ball_pivoting()
        made = meshes.current_mesh()
        vertices, faces = made.vertex_matrix().copy(), made.face_matrix().astype(np.int64)
        kept = _near(vertices, points)[faces].all(axis=1)
        meshes.clear()
        meshes.add_mesh(pymeshlab.Mesh(vertices, faces[kept]))
        for step, options in CLEANING:
            meshes.apply_filter(step, **options)
    except pymeshlab.PyMeshLabException as error:
        failed.append(meshes)
        raise FlatteningError(f"MeshLab: {' '.join(str(error).split())}") from None
    made = meshes.current_mesh()
    if made.face_number() == 0:
        raise FlatteningError(f"{kind} gave no surface of {len(points)} points")
    mesh = Mesh(made.vertex_matrix() * radius + centre, made.face_matrix())
    report: dict[str, object] = {
        "reconstruction": kind,
        "normals": "estimated" if cloud.normals is None else "given",
        "faces": len(faces),
        "faces_far_from_points": int((~kept).sum()),
        "faces_when_clean": len(mesh.faces),
        "components": mesh.component_count,
        "topology": mesh.topology,
    }
    return mesh, report


def _near(vertices: FloatArray, points: FloatArray) -> BoolArray:
    """(V,) whether a vertex is within REACH of the points (P, 3)."""
    tree = cKDTree(points)
    spacing = tree.query(points, min(NEIGHBOURS + 1, len(points)))[0][:, 1:].mean(axis=1)
    distance, nearest = tree.query(vertices)
    return np.asarray(distance <= REACH * spacing[nearest])


def carried(
    points: FloatArray, mesh: Mesh, flat: Parameterization
) -> tuple[FloatArray, FloatArray]:
    """(P, 2) the uv of the place on the mesh nearest to each point, and (P,) how far it is.

    Args:
        points: (P, 3) points.
        mesh: a mesh near to them.
        flat: its map.
    """
    squared, face, place = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    corners = [np.ascontiguousarray(mesh.vertices[mesh.faces[face, k]]) for k in range(3)]
    share = igl.barycentric_coordinates(np.ascontiguousarray(place), *corners)
    flat_faces = ~np.isfinite(share).all(axis=1)  # no area: the nearest corner is as good
    apart = np.stack([np.linalg.norm(place - corner, axis=1) for corner in corners], axis=1)
    share[flat_faces] = np.eye(3)[apart[flat_faces].argmin(axis=1)]
    uv = (share[:, :, None] * flat.uv[flat.corners[face]]).sum(axis=1)
    return uv, np.sqrt(squared)
