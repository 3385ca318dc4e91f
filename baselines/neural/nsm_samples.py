"""Places on the triangles that Neural Surface Maps (`baselines.neural.nsm`) are fitted to."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Samples(NamedTuple):
    """Places on triangles that lie both in the plane and in space.

    Attributes:
        uv: (N, 2) in the plane.
        points: (N, 3) the same in space.
        normals: (N, 3) of the triangles, unit.
        jacobians: (N, 3, 2) of the map from the plane to space.
    """

    uv: Tensor
    points: Tensor
    normals: Tensor
    jacobians: Tensor

    def rows(self, chosen: Tensor) -> Samples:
        """Some of them."""
        return Samples(*(of[chosen] for of in self))


class Triangles:
    """The triangles of a flat mesh and those in space, to draw samples from.

    Args:
        flat: (F, 3, 2) corners in the plane, none flipped.
        solid: (F, 3, 3) corners in space.
    """

    def __init__(self, flat: Tensor, solid: Tensor) -> None:
        self.flat, self.solid = flat.float(), solid.float()
        cross = torch.linalg.cross(solid[:, 1] - solid[:, 0], solid[:, 2] - solid[:, 0])
        self.area = cross.norm(dim=1)
        self.normals = (cross / self.area[:, None]).float()
        edges = [(of[:, 1:] - of[:, :1]).mT for of in (flat, solid)]
        self.jacobians = (edges[1] @ torch.linalg.inv(edges[0])).float()

    def drawn(self, count: int, generator: torch.Generator) -> Samples:
        """Places drawn evenly by area in space."""
        face = torch.multinomial(self.area, count, replacement=True, generator=generator)
        first, second = torch.rand(2, count, 1, generator=generator)
        root = first.sqrt()
        share = torch.stack([1 - root, root * (1 - second), root * second], dim=1)
        uv, points = ((share * of[face]).sum(1) for of in (self.flat, self.solid))
        return Samples(uv, points, self.normals[face], self.jacobians[face])
