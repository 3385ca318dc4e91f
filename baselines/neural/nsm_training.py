"""Batches and losses of Neural Surface Maps (`baselines.neural.nsm`)."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor, nn

from baselines.neural.nsm_networks import Refinement, SurfaceMap, jacobians
from baselines.neural.nsm_samples import Samples
from baselines.neural.sheets import with_axes

RATES = (1e-2, 2e-3)
"""Learning rates at the start, of the surface map and of the refining one; they fall to 0."""
NORMAL_WEIGHT = 0.01
"""Weight of the normals beside the positions, the paper's."""
FLIP_WEIGHT = 100.0
"""Weight of flips in the refinement."""
EPSILON = 0.01
"""The paper's ε, added to a first form before it is inverted."""
TINY = 1e-6
"""Added to squared determinants of the refinement, and the least mean distance that others are
weighed by, so that nothing is divided by 0."""
ROUND = 1_000
"""Steps after which the samples are weighed anew."""
AT_ONCE = 8_192
"""Samples whose errors are looked at together."""


def batches(
    surface: SurfaceMap, samples: Samples, size: int, generator: torch.Generator
) -> Iterator[Tensor]:
    """Rows (size,) of the samples for one step after another, without end.

    Half of them are drawn evenly, and half in proportion to how far the map is off there: between
    the two sides of a seam that nearly touch in the plane it stays far off for long.
    """
    while True:
        apart = distances(surface, samples)
        weight = 1 + apart / apart.mean().clamp(min=TINY)
        rows = torch.multinomial(weight, ROUND * size, replacement=True, generator=generator)
        yield from rows.reshape(ROUND, size)


@torch.no_grad()
def distances(surface: SurfaceMap, samples: Samples) -> Tensor:
    """(N,) how far the map is off at each sample."""
    parts = zip(*(torch.split(of, AT_ONCE) for of in (samples.uv, samples.points)), strict=True)
    return torch.cat([(surface(uv[None])[0] - points).norm(dim=1) for uv, points in parts])


def overfit_terms(surface: SurfaceMap, at: Samples) -> dict[str, Tensor]:
    """Squared distances of positions and of unit normals, means over the samples."""
    made, along, across = surface(with_axes(at.uv))
    normals = nn.functional.normalize(torch.linalg.cross(along, across), dim=1)
    return {
        "position": (made - at.points).square().sum(1).mean(),
        "normal": NORMAL_WEIGHT * (normals - at.normals).square().sum(1).mean(),
    }


def first_forms(surface: SurfaceMap, uv: Tensor) -> Tensor:
    """(N, 2, 2) the first fundamental form Jᵀ J of the neural surface at places (N, 2)."""
    with torch.no_grad():
        jacobian = jacobians(surface(with_axes(uv)))
    return jacobian.mT @ jacobian


def distortion_terms(refinement: Refinement, uv: Tensor, forms: Tensor) -> dict[str, Tensor]:
    """The symmetric Dirichlet energy of f ∘ h⁻¹ and the flips of h, means over places (N, 2).

    With J the Jacobian of h and I the first form of f, M = J⁻ᵀ I J⁻¹ is the first form of f ∘ h⁻¹.
    The energy is tr M + tr M⁻¹, 4 for an isometry; ε is added to the I that is inverted, so that it
    is 3.98 there.
    """
    J = jacobians(refinement(with_axes(uv)))
    determinant = torch.linalg.det(J)
    adjugate = adjugates(J)
    there = adjugate.mT @ forms @ adjugate / (determinant.square() + TINY)[:, None, None]
    safe = forms + EPSILON * torch.eye(2)
    back = J @ adjugates(safe) @ J.mT / torch.linalg.det(safe)[:, None, None]
    traces = (there + back).diagonal(dim1=1, dim2=2).sum(1)
    return {
        "distortion": traces.mean(),
        "flip": FLIP_WEIGHT * (-determinant).clamp(min=0).mean(),
    }


def adjugates(matrices: Tensor) -> Tensor:
    """(N, 2, 2) determinants times inverses."""
    (a, b), (c, d) = matrices.permute(1, 2, 0)
    return torch.stack([torch.stack([d, -b], dim=1), torch.stack([-c, a], dim=1)], dim=1)


@torch.no_grad()
def figures(surface: SurfaceMap, refinement: Refinement, at: Samples) -> dict[str, float]:
    """How far the networks are from the triangles at some places, and how much they distort.

    The root mean square distance; the median relative error of the derivatives, and its root mean
    square; the distortion (see `distortion_terms`) before and after the refinement; and the share
    of the places that the refinement flips.
    """
    pushed = surface(with_axes(at.uv))
    apart = (jacobians(pushed) - at.jacobians).square().sum((1, 2))
    apart = apart / at.jacobians.square().sum((1, 2))
    forms = first_forms(surface, at.uv)
    still = Refinement(torch.Generator())
    before, after = (distortion_terms(of, at.uv, forms) for of in (still, refinement))
    turned = torch.linalg.det(jacobians(refinement(with_axes(at.uv)))) <= 0
    return {
        "distance": (pushed[0] - at.points).square().sum(1).mean().sqrt().item(),
        "derivative_error": apart.sqrt().median().item(),
        "derivative_error_rms": apart.mean().sqrt().item(),
        "distortion_before": before["distortion"].item(),
        "distortion_after": after["distortion"].item(),
        "flipped": turned.float().mean().item(),
    }
