"""The five sub-networks with a given map held in them, by local features at anchors.

Cut and Stitch hold the map and its inverse: their layer blends affine maps at anchors. Unwrap and
Wrap drop and add the third coordinate of the opened surface, which is flat already. Deform is a
network as in the paper, and the only one with parameters to train.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree
from torch import Tensor, nn

from parapoint.learned.networks import Activation, OffsetStack, SubNetworks
from parapoint.surfaces.surface import FloatArray

NEIGHBOURS = 16
"""Anchors that are candidates for the blend next to each anchor, itself included."""
BLENDED = 6
"""Most anchors in the blend at a point."""
JUMP = 3.0
"""The values of neighbours on one side of a seam differ by at most so many times what their
Jacobians allow."""
NEAREST = 1e-7
"""Distance under which a point is on an anchor."""


class Anchors(NamedTuple):
    """A map known at A points: values and derivatives.

    Attributes:
        points: (A, I).
        values: (A, O).
        jacobians: (A, O, I).
    """

    points: FloatArray
    values: FloatArray
    jacobians: FloatArray


class LocalFeatures(nn.Module):
    """A map R³ → R³ that interpolates affine maps at anchors and jumps across seams alone.

    y(x) = Σ_j w_j(x) (value_j + J_j (x − anchor_j)) with the modified Shepard weights of Franke
    and Nielson 1980, w_j ∝ (1 / d_j − 1 / R)², over the anchors near x that lie on the same side
    of the seam as the nearest one. Tangents t are mapped to Σ_j w_j J_j t: at an anchor this is
    the derivative, elsewhere the change of the weights is left out.
    """

    anchors: Tensor
    values: Tensor
    jacobians: Tensor
    neighbours: Tensor

    def __init__(self, count: int) -> None:
        super().__init__()
        self.register_buffer("anchors", torch.zeros(count, 3))
        self.register_buffer("values", torch.zeros(count, 3))
        self.register_buffer("jacobians", torch.zeros(count, 3, 3))
        self.register_buffer("neighbours", torch.zeros(count, NEIGHBOURS, dtype=torch.int64))
        self._tree: cKDTree | None = None

    def hold(self, anchors: Anchors) -> None:
        """Take over a map R³ → R³; it is across a seam from an anchor where it jumps (JUMP)."""
        points, values, jacobians = anchors
        distance, near = cKDTree(points).query(points, NEIGHBOURS)
        stretch = np.linalg.norm(jacobians, ord=2, axis=(1, 2))
        reach = JUMP * np.maximum(stretch[:, None], stretch[near]) * distance
        jump = np.linalg.norm(values[near] - values[:, None], axis=2)
        near = np.where(jump <= reach, near, -1)
        near[:, 0] = np.arange(len(points))
        self.anchors.copy_(torch.from_numpy(points))
        self.values.copy_(torch.from_numpy(values))
        self.jacobians.copy_(torch.from_numpy(jacobians))
        self.neighbours.copy_(torch.from_numpy(near))
        self._tree = None

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 3) points and tangents → the same shape."""
        near = self.neighbours[self._nearest(x[0])]
        squared = (x[0][:, None] - self.anchors[near.clamp(min=0)]).square().sum(2)
        squared = squared.masked_fill(near < 0, torch.inf)
        squared, order = squared.topk(BLENDED + 1, dim=1, largest=False)
        near = near.gather(1, order)[:, :-1].clamp(min=0)
        weights = _shepard_weights(squared)
        jacobians = self.jacobians[near]
        offsets = x[0][:, None] - self.anchors[near]
        local = self.values[near] + torch.einsum("nkoi,nki->nko", jacobians, offsets)
        points = (weights[:, :, None] * local).sum(1)
        if len(x) == 1:
            return points[None]
        tangents = torch.einsum("nk,nkoi,tni->tno", weights, jacobians, x[1:])
        return torch.cat([points[None], tangents])

    def _nearest(self, x: Tensor) -> Tensor:
        """(N,) the nearest anchor of points (N, 3)."""
        if self._tree is None:
            self._tree = cKDTree(self.anchors.cpu().numpy())
        return torch.from_numpy(self._tree.query(x.detach().cpu().numpy())[1]).to(x.device)


def _shepard_weights(squared: Tensor) -> Tensor:
    """(N, K) weights of the first K of K + 1 squared distances, ascending, infinite if missing.

    The last one is R²; where it is missing, R² is half as much again as the largest there is.
    """
    last = squared[:, -1:]
    largest = squared.masked_fill(squared.isinf(), 0).amax(1, keepdim=True)
    reach = last.where(last.isfinite(), 1.5 * largest).clamp(min=NEAREST**2).sqrt()
    distance = squared[:, :-1].clamp(min=NEAREST**2).sqrt()
    weights = (1 / distance - 1 / reach).clamp(min=0).square()
    # Where all are as far as R they count alike.
    weights = weights + 1e-12 * squared[:, :-1].isfinite()
    return weights / weights.sum(1, keepdim=True)


class Lift(nn.Module):
    """Wrap for a flat opened surface: (u, v) → (u, v, 0)."""

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 2) points and tangents → (1 + T, N, 3)."""
        return nn.functional.pad(x, (0, 1))


class Projection(nn.Module):
    """Unwrap for a flat opened surface: (u, v, w) → (u, v)."""

    def forward(self, x: Tensor) -> Tensor:
        """(1 + T, N, 3) points and tangents → (1 + T, N, 2)."""
        return x[:, :, :2]


class AnchoredNetworks(SubNetworks):
    """Deform as in the paper; Cut and Stitch that hold a map at `count` anchors."""

    cut: LocalFeatures
    stitch: LocalFeatures

    def __init__(
        self,
        count: int,
        hidden: tuple[int, ...],
        embedding: int,
        activation: Activation,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.deform = OffsetStack(2, embedding, hidden, activation, generator)
        self.cut, self.stitch = LocalFeatures(count), LocalFeatures(count)
        self.wrap, self.unwrap = Lift(), Projection()

    def hold(self, forward: Anchors, inverse: FloatArray) -> None:
        """Take over a map of the surface to the plane.

        Args:
            forward: points (A, 3), uv (A, 2), d uv / d x (A, 2, 3).
            inverse: d x / d uv (A, 3, 2).
        """
        points, uv, jacobians = forward
        opened = np.pad(uv, ((0, 0), (0, 1)))
        self.cut.hold(Anchors(points, opened, np.pad(jacobians, ((0, 0), (0, 1), (0, 0)))))
        self.stitch.hold(Anchors(opened, points, np.pad(inverse, ((0, 0), (0, 0), (0, 1)))))
