"""The terms of the training objective (paper, section 3.4), each a function of tensors alone.

The paper writes sums; these are means over the points (and sums over the neighbours of a point),
as in the group's later code, so that the weights do not depend on the number of points.
"""

from __future__ import annotations

import math

import torch
from scipy.spatial import cKDTree
from torch import Tensor

EPSILON = 1e-12
"""Added under square roots whose gradient is infinite at 0: of distances, in the shape's radius;
of stretches, in their own size, so that it stays small where a map shrinks all."""
SMALLEST = 1e-30
"""Added beside EPSILON, in the fourth power of the shape's radius, so that no root is taken of 0
where all stretches are 0."""

LARGEST_LOG = 3.0
"""Deviation of a log area beyond which it counts as this much: 20 times too large or too small."""


class NotFiniteError(ArithmeticError):
    """The maps have left the finite numbers: the training diverged."""


def nearest(queries: Tensor, points: Tensor, count: int) -> Tensor:
    """(N, count) rows of `points` (M, d) nearest to each of `queries` (N, d), nearest first.

    No gradient. On a CPU by a k-d tree, 20 times as fast at 2,000 points as all distances; on a
    CUDA device by exact distances (not the matrix trick, which is off by 2e-4 near 0), in slices
    of bounded memory.

    Raises:
        NotFiniteError: a coordinate is NaN or infinite.
    """
    queries, points = queries.detach(), points.detach()
    if not bool(queries.isfinite().all() and points.isfinite().all()):
        raise NotFiniteError
    if queries.device.type == "cpu":
        _, index = cKDTree(points.numpy()).query(queries.numpy(), count)
        return torch.from_numpy(index.reshape(len(queries), count))
    exact = "donot_use_mm_for_euclid_dist"
    rows = max(1, 2**26 // len(points))
    found = []
    for begin in range(0, len(queries), rows):
        distance = torch.cdist(queries[begin : begin + rows], points, compute_mode=exact)
        found.append(distance.topk(count, largest=False).indices)
    return torch.cat(found)


def neighbours(points: Tensor, count: int) -> Tensor:
    """(N, count) the nearest other rows of each of `points` (N, d)."""
    return nearest(points, points, count + 1)[:, 1:]


def box_side(uv: Tensor) -> Tensor:
    """L(Q): the side of the square bounding box of (N, 2) coordinates."""
    return (uv.amax(0) - uv.amin(0)).max()


def unwrap_loss(uv: Tensor, neighbour_count: int, spacing: float) -> Tensor:
    """l_unwrap, eq. "unwrap-loss": Σ_i Σ_k max(0, ε − ‖q_i − q_i^(k)‖), ε = spacing · L(Q) / √N.

    Args:
        uv: Q (N, 2).
        neighbour_count: K_u, nearest in the plane.
        spacing: 0.1 in the paper.
    """
    near = uv[neighbours(uv, neighbour_count)]
    distance = ((uv[:, None] - near).square().sum(2) + EPSILON).sqrt()
    epsilon = spacing * box_side(uv.detach()) / math.sqrt(len(uv))
    return (epsilon - distance).clamp(min=0).sum(1).mean()


def wrap_loss(made: Tensor, given: Tensor) -> Tensor:
    """l_wrap = CD(P̂, P): the larger of the mean distances from each set to the other's nearest.

    Distances are not squared; the paper names no form, this one is of the group's later code.

    Args:
        made: P̂ (M, 3).
        given: P (N, 3).
    """
    to_given = made - given[nearest(made, given, 1)[:, 0]]
    to_made = given - made[nearest(given, made, 1)[:, 0]]
    return torch.maximum(
        (to_given.square().sum(1) + EPSILON).sqrt().mean(),
        (to_made.square().sum(1) + EPSILON).sqrt().mean(),
    )


def cycle_loss(first: Tensor, second: Tensor) -> Tensor:
    """One of the four terms of l_cycle: mean L1 distance of (N, d) points that should be equal."""
    return (first - second).abs().sum(1).mean()


def first_fundamental_form(tangents: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """E = f_u·f_u, F = f_u·f_v, G = f_v·f_v, each (N,), of tangents (2, N, 3)."""
    u, v = tangents
    return (u * u).sum(1), (u * v).sum(1), (v * v).sum(1)


def singular_values(tangents: Tensor) -> tuple[Tensor, Tensor]:
    """λ1 ≥ λ2 (N,) of the Jacobians J = (f_u f_v), given as (2, N, 3), in closed form.

    (λ1 ± λ2)² = E + G ± 2 |f_u × f_v|. The difference is taken as (λ1² − λ2²) / (λ1 + λ2): the
    other form loses half of its digits near a conformal map.
    """
    E, F, G = first_fundamental_form(tangents)
    area = torch.linalg.cross(tangents[0], tangents[1]).square().sum(1)
    total = (E + G + 2 * (area + _floor(E + G)).sqrt()).sqrt()
    difference = _split(E, F, G) / total
    return (total + difference) / 2, (total - difference) / 2


def gram_eigenvalues(tangents: Tensor) -> tuple[Tensor, Tensor]:
    """λ1 ≥ λ2 (N,) of JᵀJ: the other reading of "eigenvalues of J"; squares of the first."""
    E, F, G = first_fundamental_form(tangents)
    difference = _split(E, F, G)
    return (E + G + difference) / 2, (E + G - difference) / 2


def _split(E: Tensor, F: Tensor, G: Tensor) -> Tensor:
    """λ1² − λ2² of the singular values."""
    return ((E - G).square() + 4 * F.square() + _floor(E + G)).sqrt()


def _floor(stretch: Tensor) -> Tensor:
    """What is added under the root of a square of stretches of this size."""
    return EPSILON * stretch.detach().square() + SMALLEST


EIGENVALUES = {"singular": singular_values, "gram": gram_eigenvalues}
"""What is read as "the eigenvalues of the Jacobian matrices", which are 3×2."""


def conformal_loss(first: Tensor, second: Tensor) -> Tensor:
    """One of the two terms of l_conf: mean of |λ1 − λ2|."""
    return (first - second).abs().mean()


def isometric_loss(first: Tensor, second: Tensor) -> Tensor:
    """One of the two terms of l_isom: mean of |λ1 − 1| + |λ2 − 1|."""
    return ((first - 1).abs() + (second - 1).abs()).mean()


DISTORTIONS = {"conformal": conformal_loss, "isometric": isometric_loss}
"""l_conf, and l_isom that may stand in its place."""


def anti_flip_loss(points: Tensor, tangents: Tensor, neighbour_count: int, angle: float) -> Tensor:
    """One of the two terms of l_aflip, eq. "aflip-loss": Σ_k max(0, cos T − n·n^(k)), mean.

    The paper subtracts an angle from "the cosine similarity"; cosines on both sides is the reading
    in which its T = π/2 makes sense: neighbours whose normals differ by more than T are penalised.

    Args:
        points: (N, 3), where the neighbours are looked for.
        tangents: (2, N, 3), their cross products are the normals.
        neighbour_count: 4 in the paper.
        angle: T in radians.
    """
    normals = torch.nn.functional.normalize(
        torch.linalg.cross(tangents[0], tangents[1]), dim=1, eps=EPSILON
    )
    near = normals[neighbours(points, neighbour_count)]
    cosine = (normals[:, None] * near).sum(2)
    return (math.cos(angle) - cosine).clamp(min=0).sum(1).mean()


def unfolding_loss(unfolding: Tensor, area_weight: float = 0.0) -> Tensor:
    """Distortion of Unwrap∘Cut on the surface itself; not in the paper.

    Mean of (λ1 − λ2)² / (λ1² + λ2²) = (E + G − 2 det) / (E + G), in [0, 2]: 0 where conformal, 1
    on a collapsed line, above 1 where det < 0, which is a fold. And of the squared deviations of
    log det from its median, which are the same for a part that is e times too large and for one
    that is e times too small; by them it pays to cut.

    Args:
        unfolding: (2, N, 2) images of two tangent vectors, orthonormal and right-handed around the
            surface's oriented normal.
        area_weight: of the second part.
    """
    (a, b), (c, d) = unfolding[0].unbind(1), unfolding[1].unbind(1)
    stretch, area = a * a + b * b + c * c + d * d, a * d - b * c
    angles = ((stretch - 2 * area) / (stretch + EPSILON)).mean()
    if not area_weight:
        return angles
    log_area = area.clamp(min=EPSILON).log()
    deviation = (log_area - log_area.detach().median()).clamp(-LARGEST_LOG, LARGEST_LOG)
    return angles + area_weight * deviation.square().mean()
