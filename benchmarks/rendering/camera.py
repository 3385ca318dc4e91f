"""An orthographic camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from parapoint.surfaces.surface import FloatArray, Mesh


@dataclass(frozen=True, eq=False)
class Camera:
    """An orthographic camera.

    Attributes:
        axes: (3, 3) rows: right, up, and from the surface to the eye.
        centre: (3,) the point in the middle of the image.
        half: (2,) half of the width and of the height of the image, in units of the surface.
    """

    axes: FloatArray
    centre: FloatArray
    half: FloatArray

    def screen(self, points: FloatArray) -> FloatArray:
        """(n, 3) right, up and towards the eye, of (n, 3) points, about the centre."""
        return np.asarray((points - self.centre) @ self.axes.T, dtype=np.float64)


def camera(mesh: Mesh, toward: FloatArray, up: FloatArray, margin: float = 1.04) -> Camera:
    """The camera that looks along -`toward` (3,), `up` (3,) upright, with all of the mesh in it."""
    back = toward / np.linalg.norm(toward)
    right = np.cross(up, back)
    right = right / np.linalg.norm(right)
    axes = np.stack([right, np.cross(back, right), back])
    seen = mesh.vertices[mesh.referenced] @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    half = np.maximum((high - low)[:2] / 2, (high - low).max() / 8) * margin
    return Camera(axes=axes, centre=(low + high) / 2 @ axes, half=half)
