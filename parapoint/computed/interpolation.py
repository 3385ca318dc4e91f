"""A map that is known at some points, with its derivatives, carried to all points near them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from scipy.spatial import cKDTree

from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

NEIGHBOURS = 16
"""Anchors that may have a say near each anchor, itself included."""
BLENDED = 6
"""Largest number of anchors whose affine maps are blended at a point."""
JUMP = 3.0
"""Two anchors lie on different sides of a seam where their values differ by more than this many
times what the larger of their two derivatives allows over their distance."""
NEAREST = 1e-7
"""Distance, in radii of the surface, below which a point counts as lying on an anchor."""
BATCH = 16_384
"""Points that are interpolated at a time, which bounds the memory to some 50 MB."""


class Anchors(NamedTuple):
    """A map Rᴵ → Rᴼ known at A points: values and derivatives.

    Attributes:
        points: (A, I).
        values: (A, O).
        jacobians: (A, O, I).
    """

    points: FloatArray
    values: FloatArray
    jacobians: FloatArray


@dataclass(frozen=True, eq=False)
class Interpolant:
    """Interpolates affine maps at anchors, and jumps across seams alone.

    y(x) = Σ_j w_j(x) (value_j + J_j (x − anchor_j)) with the modified Shepard weights of Franke
    and Nielson 1980, w_j ∝ (1 / d_j − 1 / R)², over the anchors near x that lie on the same side
    of the seam as the nearest one. At an anchor this is its value.

    Attributes:
        anchors: the map where it is known.
        neighbours: (A, NEIGHBOURS) for each anchor the nearest ones, −1 for those across a seam.
    """

    anchors: Anchors
    neighbours: IntArray

    @classmethod
    def of(cls, anchors: Anchors) -> Self:
        """The interpolant of a map; anchors across a seam from one another are told by JUMP."""
        points, values, jacobians = anchors
        distance, near = cKDTree(points).query(points, min(NEIGHBOURS, len(points)))
        stretch = np.linalg.norm(jacobians, ord=2, axis=(1, 2))
        reach = JUMP * np.maximum(stretch[:, None], stretch[near]) * distance
        jump = np.linalg.norm(values[near] - values[:, None], axis=2)
        near = np.where(jump <= reach, near, -1)
        near[:, 0] = np.arange(len(points))
        missing = ((0, 0), (0, NEIGHBOURS - near.shape[1]))
        return cls(anchors, np.pad(near, missing, constant_values=-1))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.anchors.points)

    def __call__(self, x: FloatArray) -> FloatArray:
        """(N, I) points → (N, O) values."""
        values = np.empty((len(x), self.anchors.values.shape[1]))
        for begin in range(0, len(x), BATCH):
            rows = slice(begin, begin + BATCH)
            values[rows] = self._blend(x[rows])
        return values

    def _blend(self, x: FloatArray) -> FloatArray:
        points, values, jacobians = self.anchors
        near = self.neighbours[self._tree.query(x, workers=-1)[1]]
        squared = ((x[:, None] - points[near]) ** 2).sum(axis=2)
        squared[near < 0] = np.inf
        order = np.argsort(squared, axis=1, kind="stable")[:, : BLENDED + 1]
        squared = np.take_along_axis(squared, order, axis=1)
        near = np.take_along_axis(near, order, axis=1)[:, :BLENDED]
        weights = shepard_weights(squared)[:, :, None]
        offsets = x[:, None] - points[near]
        local = values[near] + np.einsum("nkoi,nki->nko", jacobians[near], offsets)
        return np.asarray((weights * local).sum(axis=1))


def shepard_weights(squared: FloatArray) -> FloatArray:
    """(N, K) weights of the first K of K + 1 squared distances, ascending, infinite if missing.

    The last one is R²; where it is missing, R² is half as much again as the largest.
    """
    distance = np.sqrt(np.maximum(squared, NEAREST**2))
    known = np.where(np.isfinite(distance), distance, 0.0)
    missing = 1.5**0.5 * known.max(axis=1, keepdims=True)
    last = distance[:, -1:]
    reach = np.where(np.isfinite(last), last, missing)
    weights = np.maximum(1 / distance[:, :-1] - 1 / reach, 0.0) ** 2
    # Where all are as far as R they count alike.
    weights += 1e-12 * np.isfinite(squared[:, :-1])
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


@dataclass(frozen=True, eq=False)
class InterpolatedMap:
    """A map of a surface to the plane and its inverse, both interpolated between anchors.

    Attributes:
        forward: R³ → R².
        inverse: R² → R³, over the images of the same anchors.
        triangulation: the mesh that the map was computed on, if it was, with its map.
    """

    forward: Interpolant
    inverse: Interpolant
    triangulation: Charted | None = None

    @classmethod
    def of(
        cls, forward: Anchors, inverse_jacobians: FloatArray, triangulation: Charted | None = None
    ) -> Self:
        """The map with these anchors (A, 3) → (A, 2) and d x / d uv (A, 3, 2)."""
        backward = Anchors(forward.values, forward.points, inverse_jacobians)
        return cls(Interpolant.of(forward), Interpolant.of(backward), triangulation)

    def charted(self) -> Charted | None:
        """See `SurfaceMap`."""
        return self.triangulation

    def flatten(self, points: FloatArray) -> FloatArray:
        """See `SurfaceMap`."""
        return self.forward(points)

    def lift(self, uv: FloatArray) -> FloatArray:
        """See `SurfaceMap`."""
        return self.inverse(uv)

    def arrays(self) -> dict[str, np.ndarray]:
        """See `SurfaceMap`."""
        anchors = self.forward.anchors
        arrays: dict[str, np.ndarray] = {
            "points": anchors.points,
            "uv": anchors.values,
            "jacobians": anchors.jacobians,
            "inverse_jacobians": self.inverse.anchors.jacobians,
        }
        if self.triangulation is not None:
            mesh, held = self.triangulation
            arrays |= {"vertices": mesh.vertices, "faces": mesh.faces}
            arrays |= {"corner_uv": held.uv, "corners": held.corners}
        return arrays

    def facts(self) -> dict[str, Any]:
        """See `SurfaceMap`."""
        return {}

    @classmethod
    def restored(cls, arrays: dict[str, np.ndarray]) -> Self:
        """The map that `arrays` returned."""
        forward = Anchors(arrays["points"], arrays["uv"], arrays["jacobians"])
        triangulation = None
        if "vertices" in arrays:
            mesh = Mesh(arrays["vertices"], arrays["faces"])
            triangulation = Charted(mesh, Parameterization(arrays["corner_uv"], arrays["corners"]))
        return cls.of(forward, arrays["inverse_jacobians"], triangulation)
