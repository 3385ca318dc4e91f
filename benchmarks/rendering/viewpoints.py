"""From where a surface is looked at, so that its shape can be told."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from benchmarks.rendering.camera import Camera, camera
from benchmarks.rendering.scene import Scene
from parapoint.surfaces.surface import FloatArray, Mesh

RING = 48
"""Directions around the upright axis that are tried for a view."""

THREE_QUARTERS = 5
"""Steps of the ring by which a front is turned for its view at three quarters (37 degrees)."""

TILT = 0.30
"""The camera looks down by the angle of this slope."""


def two_cameras(scene: Scene) -> tuple[Camera, Camera]:
    """Two views that show the shape: its front at three quarters, and what that leaves unseen.

    The front is the direction around the upright axis with most to see: visible surface, weighted
    by how much it turns there (faces, fingers, horns over flat backs). On a mirror-symmetric shape
    it is the more detailed of the two directions within the plane of symmetry, and the view is
    turned off it. The second view shows as much as possible of what the first does not.
    """
    mesh = scene.mesh
    up = upright(mesh)
    level = np.eye(3)[(np.abs(up).argmax() + 1) % 3]
    azimuth = np.arange(RING) * 2 * np.pi / RING
    ring = np.cos(azimuth)[:, None] * level + np.sin(azimuth)[:, None] * np.cross(up, level)
    cameras = [camera(mesh, direction + TILT * up, up) for direction in ring]
    area = np.maximum(mesh.face_areas, 1e-30)
    shown = np.stack([scene.view(at, 96, 1).shown_areas for at in cameras])
    side = int(np.argmax(shown.sum(axis=(0, 2))))  # the outer one, however the faces are turned
    seen = np.minimum(shown[:, side] / area, 1)
    turning = area * _turning(scene)
    gain, detail = seen @ (area + 2 * turning), seen @ turning
    mirror = _mirror(scene, ring[: RING // 2])
    if mirror is None:
        first = int(np.argmax(gain))
    else:
        ends = [(mirror + RING // 4) % RING, (mirror + 3 * RING // 4) % RING]
        front = max(ends, key=lambda end: float(detail[end]))
        turned = [(front + step) % RING for step in (-THREE_QUARTERS, THREE_QUARTERS)]
        first = max(turned, key=lambda at: float(gain[at]))
    second = int(np.argmax(np.maximum(seen - seen[first], 0) @ area))
    return cameras[first], cameras[second]


def _mirror(scene: Scene, normals: FloatArray) -> int | None:
    """The row of `normals` (n, 3) of the plane in which the surface mirrors itself, if any."""
    mesh = scene.mesh
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    middle = np.average(centres, axis=0, weights=np.maximum(mesh.face_areas, 1e-30))
    tree = cKDTree(centres)
    stride = max(1, len(centres) // 1000)
    some = centres[::stride] - middle
    weights = np.maximum(mesh.face_areas[::stride], 1e-30)
    misfit = []
    for normal in normals:
        distance, _ = tree.query(some - 2 * (some @ normal)[:, None] * normal + middle)
        misfit.append(float(np.average(distance, weights=weights)))
    spacing = np.sqrt(mesh.face_areas.sum() / len(mesh.faces))
    best = int(np.argmin(misfit))
    return best if misfit[best] < spacing + 0.02 * scene.size else None


def _turning(scene: Scene) -> FloatArray:
    """(F,) how much the surface turns around each face: 0 if flat, 1 in the strongest twentieth."""
    mesh = scene.mesh
    spread = 1 - np.einsum("fki,fi->fk", scene.corner_normals, scene.face_normals).min(axis=1)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    at = sparse.csr_matrix((np.ones(len(face)), (face, mesh.faces.reshape(-1))))
    near = at @ at.T
    smooth = near @ (spread * mesh.face_areas) / np.maximum(near @ mesh.face_areas, 1e-30)
    return np.asarray(np.minimum(smooth / max(float(np.quantile(smooth, 0.95)), 1e-12), 1))


def upright(mesh: Mesh) -> FloatArray:
    """(3,) the axis direction that points up.

    A surface with a large opening (a bust's neck, a glove, the floor of a car) stands on it. A
    closed one with a flat base stands on that. Else y points up, as modelling programs have it.
    """
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    if mesh.boundary_loops:
        loop = mesh.vertices[mesh.boundary_loops[0]]
        middle = loop.mean(axis=0)
        area = np.cross(loop - middle, np.roll(loop, -1, axis=0) - middle).sum(axis=0) / 2
        surface = (mesh.face_areas[:, None] * mesh.vertices[mesh.faces].mean(axis=1)).sum(axis=0)
        away = surface / max(float(mesh.face_areas.sum()), 1e-30) - middle
        area = area * np.sign(area @ away)
        if np.linalg.norm(area) > 0.01 * mesh.face_areas.sum():
            return np.asarray(axes[np.argmax(axes @ area)])
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a) / 2
    heights = mesh.vertices[mesh.faces].mean(axis=1) @ axes.T
    floor = heights.min(axis=0) + 0.02 * np.ptp(heights, axis=0)
    down = -(normals @ axes.T)
    flat = (down > 0.98 * mesh.face_areas[:, None]) & (heights < floor)
    base = (down * flat).sum(axis=0)
    if base.max() > 0.03 * mesh.face_areas.sum():
        return np.asarray(axes[np.argmax(base)])
    return np.asarray(axes[1])
