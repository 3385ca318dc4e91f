"""The angles of a flat mesh nearest to those in space: constraints, and a step towards them."""

from __future__ import annotations

from typing import NamedTuple

import igl
import numpy as np
from scipy import sparse

from parapoint.surfaces.surface import FloatArray, IntArray

SHARPEST = 1e-3
"""Least angle that is aimed at, and least distance to pi, in radians."""


class Angles(NamedTuple):
    """The corners of a closed-up disk as a problem of angles.

    Attributes:
        target: (3 F,) the angles aimed at.
        wheel: (I, 3 F) sums a corner's values around each inner vertex.
        ahead: (3 F,) for each corner the next one in its triangle.
    """

    target: FloatArray
    wheel: sparse.csr_array
    ahead: IntArray


def angles(vertices: FloatArray, faces: IntArray) -> Angles:
    """The problem of a disk (V, 3), (F, 3) without holes."""
    corner = faces.reshape(-1)
    count = np.arange(len(corner))
    inner = np.setdiff1d(corner, igl.boundary_loop(faces))
    row = np.full(len(vertices), -1)
    row[inner] = np.arange(len(inner))
    used = row[corner] >= 0
    ends = row[corner[used]], count[used]
    wheel = sparse.coo_array((np.ones(used.sum()), ends), (len(inner), len(corner))).tocsr()
    target = np.asarray(igl.internal_angles(vertices, faces)).reshape(-1)
    target[used] *= (2 * np.pi / (wheel @ target))[row[corner[used]]]
    target = target.clip(SHARPEST, np.pi - SHARPEST)
    return Angles(target, wheel, np.roll(count.reshape(-1, 3), -1, axis=1).reshape(-1))


def newton_step(problem: Angles, angle: FloatArray) -> tuple[FloatArray, float]:
    """(3 F,) how the angles should move, and the largest error of a constraint before that."""
    target, wheel, ahead = problem
    behind = ahead[ahead]
    log_sine, cotangent = np.log(np.sin(angle)), 1 / np.tan(angle)
    triangle = angle.reshape(-1, 3).sum(axis=1) - np.pi
    around = wheel @ angle - 2 * np.pi
    closing = wheel @ (log_sine[ahead] - log_sine[behind])
    size = len(angle)
    turn, back = (
        sparse.coo_array((cotangent[end], (np.arange(size), end)), (size, size)).tocsr()
        for end in (ahead, behind)
    )
    jacobian = sparse.vstack([wheel, wheel @ (turn - back)]).tocsr()
    # L = diag(2 / target²); J1 sums each triangle, J2 is `jacobian`.
    inverse = target**2 / 2
    pull = -2 * (angle - target) / target**2
    weighted = (jacobian * inverse).tocsr()
    triangles = sparse.kron(sparse.identity(size // 3), np.ones((3, 1))).tocsr()
    share = inverse.reshape(-1, 3).sum(axis=1)
    both = (weighted @ triangles).tocsr()
    first = (inverse * pull).reshape(-1, 3).sum(axis=1) + triangle
    second = weighted @ pull + np.concatenate([around, closing])
    schur = (weighted @ jacobian.T - (both / share) @ both.T).tocsc()
    second_multiplier = np.zeros(0)
    if len(second):
        second_multiplier = solved(schur, second - both @ (first / share))
    first_multiplier = (first - both.T @ second_multiplier) / share
    move = inverse * (pull - np.repeat(first_multiplier, 3) - jacobian.T @ second_multiplier)
    wrong = np.abs(np.concatenate([triangle, around, closing])).max()
    return move, float(wrong)


def solved(matrix: sparse.csc_array, right: FloatArray) -> FloatArray:
    """(n,) the solution of a symmetric positive definite system, by Cholesky factors (libigl)."""
    data = igl.min_quad_with_fixed_data()
    none = np.zeros(0, dtype=np.int64)
    igl.min_quad_with_fixed_precompute(sparse.csc_matrix(matrix), none, pd=True, data=data)
    found = igl.min_quad_with_fixed_solve(data, -right[:, None], np.zeros((0, 1)))
    return np.asarray(found, dtype=np.float64).reshape(-1)
