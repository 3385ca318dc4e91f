"""Loss of DiffSR (`baselines.neural.diffsr`); its networks are AtlasNet's, which are smooth."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from baselines.neural.atlasnet_networks import AtlasNetworks, chamfer
from baselines.neural.sheets import random_places, with_axes
from parapoint.learned.losses import EPSILON, first_fundamental_form, neighbours

DEFORMATION_WEIGHT = 1e-3
"""Weight "alpha_def" of L_E + L_G + L_sk + L_str."""
OVERLAP_WEIGHT = 1e-2
"""Weight "alpha_ol" of L_ol, where the surface lies in a ball of radius 1."""
SQUARE = 4.0
"""Area of the square from -1 to 1."""
NEIGHBOURS = 8
"""Nearest points whose distance tells how much of the surface a point stands for."""


class DiffSRNetworks(AtlasNetworks):
    """AtlasNet's networks under DiffSR's loss."""

    def terms(self, given: Tensor, count: int, generator: torch.Generator) -> dict[str, Tensor]:
        """The Chamfer distance, and what the metric tensors at the same places say."""
        each = -(-count // len(self.sheets))
        rows = [sheet(with_axes(random_places(each, generator))) for sheet in self.sheets]
        found = [deformation(of[1:]) for of in rows]
        area = torch.stack([of for _, of in found]).sum()
        return {
            "chamfer": chamfer(torch.cat([of[0] for of in rows]), given),
            "deformation": DEFORMATION_WEIGHT * torch.stack([of for of, _ in found]).mean(),
            "overlap": OVERLAP_WEIGHT * (area - surface_area(given)).clamp(min=0).square(),
        }


def deformation(tangents: Tensor) -> tuple[Tensor, Tensor]:
    """L_E + L_G + L_sk + L_str of one square, and the area of its image.

    With A the mean of √(EG − F²), these are the means of ((E − mean E) / A)², ((G − mean G) / A)²,
    (F / A)² and ((E − G) / A)².

    Args:
        tangents: (2, N, 3) along both axes, at even random places of the square.
    """
    e, f, g = first_fundamental_form(tangents)
    crossed = torch.linalg.cross(tangents[0], tangents[1])
    area = (crossed.square().sum(1) + EPSILON).sqrt().mean()
    parts = torch.stack([e - e.mean(), g - g.mean(), f, e - g]) / area
    return parts.square().mean(dim=1).sum(), SQUARE * area


def surface_area(points: Tensor) -> Tensor:
    """Area of the surface that points (N, 3) are spread on, about.

    The disk up to the k-th neighbour of a point holds k points, so a point stands for 1 / k of it.
    """
    farthest = points[neighbours(points, NEIGHBOURS)[:, -1]]
    return math.pi / NEIGHBOURS * (points - farthest).square().sum()
