"""Floater's mean-value embedding: the longest boundary on a circle, inner vertices amid others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from parapoint.planar.domains import Domain, check_triangles, circle, closed_holes, domain, scaled
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Surface


@dataclass(frozen=True)
class MeanValue:
    """Mean-value embedding: positive weights that follow the shape, a circle as the boundary.

    M. S. Floater 2003, "Mean value coordinates". Each inner vertex is a convex combination of its
    neighbours with the weights

        w_ij = (tan(a / 2) + tan(b / 2)) / |v_i - v_j|,

    where a and b are the angles at v_i in the two triangles beside the edge. All are positive, so
    that no triangle flips, which cotangent weights do not promise (`harmonic`); a flat disk with a
    convex boundary held where it is comes back as it is. The paper leaves the boundary open: it is
    a circle here, spaced by arc length. Other loops are closed by a vertex each, which is at their
    mean and pulls at each of their vertices as its other neighbours do on average.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy")

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The embedding, scaled to the 3D area.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes.
            InputError: a triangle has no area.
            FlatteningError: the system has no finite solution.
        """
        disk = domain(surface)
        check_triangles(disk.vertices, disk.faces)
        uv = scaled(disk, embedded(disk, circle(disk.vertices[disk.loop])))
        areas = signed_areas(uv, disk.faces)
        flips = {"flipped": int((areas < 0).sum()), "degenerate": int((areas == 0).sum())}
        return Parameterization(uv, disk.faces, report=flips)


def embedded(disk: Domain, boundary: FloatArray) -> FloatArray:
    """(V, 2) the mean-value embedding with the domain's loop at `boundary` (B, 2)."""
    return balanced(mean_value_weights(disk), disk.loop, boundary)[: len(disk.vertices)]


def balanced(weights: sparse.csr_array, loop: IntArray, boundary: FloatArray) -> FloatArray:
    """(V, 2) each vertex at the weighted mean of its neighbours, the `loop` (B,) at `boundary`."""
    size = weights.shape[0]
    matrix = (sparse.identity(size) - sparse.diags_array(1 / weights.sum(axis=1)) @ weights).tocsr()
    inside = np.setdiff1d(np.arange(size), loop)
    uv: FloatArray = np.zeros((size, 2))
    uv[loop] = boundary
    rows = matrix[inside]
    uv[inside] = splu(rows[:, inside].tocsc()).solve(-(rows[:, loop] @ boundary))
    return uv


def mean_value_weights(disk: Domain) -> sparse.csr_array:
    """(V', V') weight of each neighbour; the rows past V are those that close the inner loops."""
    vertices, faces = closed_holes(disk)
    fans = faces[len(disk.faces) :]
    size = (len(vertices),) * 2
    corner, ahead, behind = (np.roll(disk.faces, -turn, axis=1).reshape(-1) for turn in range(3))
    first, second = (disk.vertices[end] - disk.vertices[corner] for end in (ahead, behind))
    a, b = (np.linalg.norm(side, axis=1) for side in (first, second))
    # tan(t / 2) is sin t / (1 + cos t), and (1 - cos t) / sin t where this one does not cancel.
    sine, cosine = np.linalg.norm(np.cross(first, second), axis=1), (first * second).sum(axis=1)
    tangent = np.where(cosine > 0, sine / (a * b + cosine), (a * b - cosine) / sine)
    ends = np.concatenate([corner, corner]), np.concatenate([ahead, behind])
    weights = sparse.coo_array((np.concatenate([tangent / a, tangent / b]), ends), size).tocsr()
    loop, _, centre = fans.T
    pull = weights.sum(axis=1)[loop] / np.diff(weights.indptr)[loop]
    ends = np.concatenate([loop, centre]), np.concatenate([centre, loop])
    fan = sparse.coo_array((np.concatenate([pull, np.ones(len(loop))]), ends), size)
    return (weights + fan).tocsr()
