"""What a ray meets of a mesh: by embree where its wheel exists, else by libigl's tree."""

from __future__ import annotations

from typing import Any

import igl
import numpy as np

from benchmarks.rendering.colours import Floats
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh


class Rays:
    """Ray queries against a mesh: embree where its wheel exists, else libigl's tree."""

    def __init__(self, mesh: Mesh, *, embree: bool = True) -> None:
        self._mesh = mesh
        self._frame = Frame.of(mesh.vertices[mesh.referenced])  # embree works in single precision
        self._scene: Any = None
        self._tree: Any = None
        if embree:
            try:
                from embreex.mesh_construction import TriangleMesh
                from embreex.rtcore_scene import EmbreeScene
            except ImportError:  # no wheel for this machine
                pass
            else:
                self._scene = EmbreeScene()
                TriangleMesh(
                    self._scene,
                    self._frame.inside(mesh.vertices).astype(np.float32),
                    mesh.faces.astype(np.int32),
                )
        if self._scene is None:
            self._tree = igl.AABB()
            self._tree.init(mesh.vertices, mesh.faces)

    def _near(self, origins: FloatArray) -> Floats:
        return self._frame.inside(origins).astype(np.float32)

    def first(self, origins: FloatArray, directions: Floats) -> tuple[IntArray, Floats]:
        """(n,) the face that each ray meets first, -1 for none; (n, 2) weights of corners 1, 2."""
        if self._scene is not None:
            hit = self._scene.run(self._near(origins), directions, query="INTERSECT", output=True)
            return hit["primID"].astype(np.int64), np.stack([hit["u"], hit["v"]], axis=1)
        face, _, weights = self._tree.intersect_ray_first(
            self._mesh.vertices,
            self._mesh.faces,
            origins,
            directions.astype(np.float64),
            np.inf,
        )
        # What a ray that meets nothing leaves behind is no number.
        known = np.where(face[:, None] >= 0, weights[:, -2:], 0)
        return face, known.astype(np.float32)

    def blocked(self, origins: FloatArray, directions: Floats) -> BoolArray:
        """(n,) whether each ray meets the surface."""
        if self._scene is not None:
            found = self._scene.run(self._near(origins), directions, query="OCCLUDED")
            return np.asarray(found >= 0)
        return np.asarray(self.first(origins, directions)[0] >= 0)


def sphere_directions(count: int) -> FloatArray:
    """(count, 3) unit directions, spread evenly (a Fibonacci spiral)."""
    k = np.arange(count) + 0.5
    z = 1 - 2 * k / count
    angle = np.pi * (1 + 5**0.5) * k
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
