"""The energy of Smith and Schaefer: distortion, a barrier at the boundary, a bound on steps."""

from __future__ import annotations

import math

import numpy as np
import shapely
from scipy import sparse

from parapoint.planar.domains import Domain, frames
from parapoint.surfaces.areas import cross
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh

SHORT_OF_CONTACT = 0.9
"""Share of the way to the first flip or contact that a step may take at most."""


class Boundary:
    """The boundary edges of a domain and, with a map, what they are near to.

    Attributes:
        start: (B,) first vertex of each edge.
        end: (B,) second vertex of each edge.
        reach: distance at which the barrier begins.
    """

    def __init__(self, disk: Domain, reach: float) -> None:
        loops = Mesh(disk.vertices, disk.faces).boundary_loops
        self.start = np.concatenate(loops)
        self.end = np.concatenate([np.roll(loop, -1) for loop in loops])
        self.reach = reach

    def barrier(self, uv: FloatArray) -> tuple[float, FloatArray]:
        """The mean over edges of max(0, reach / distance - 1)² to near vertices; its gradient."""
        edges = shapely.linestrings(np.stack([uv[self.start], uv[self.end]], axis=1))
        tree = shapely.STRtree(np.asarray(shapely.points(uv[self.start])))
        edge, row = tree.query(edges, predicate="dwithin", distance=self.reach)
        p, a, b = self._apart(edge, row)
        along = uv[b] - uv[a]
        share = ((uv[p] - uv[a]) * along).sum(axis=1) / (along**2).sum(axis=1)
        share = share.clip(0, 1)[:, None]
        away = uv[p] - uv[a] - share * along
        distance = np.linalg.norm(away, axis=1)
        close = np.maximum(0.0, self.reach / distance - 1)
        # The nearest point's move along the edge does not change the distance.
        push = (-2 * close * self.reach / distance**3)[:, None] * away
        slope = np.zeros_like(uv)
        for vertex, part in ((p, push), (a, (share - 1) * push), (b, -share * push)):
            for axis in range(2):
                slope[:, axis] += np.bincount(vertex, part[:, axis], len(uv))
        return float((close**2).sum()) / len(self.start), slope / len(self.start)

    def largest_step(self, uv: FloatArray, move: FloatArray, most: float) -> float:
        """The largest step along `move` (V, 2), up to `most`, before a vertex meets an edge.

        The signed area of a vertex and an edge that move is a quadratic in the step;
        at a root they are in line, and meet if the vertex is then between the edge's ends.
        """
        places = np.stack([uv, uv + most * move])
        edges = places[:, [self.start, self.end]].reshape(4, -1, 2)
        vertices = places[:, self.start]
        swept, tree = (
            shapely.box(*of.min(axis=0).T, *of.max(axis=0).T) for of in (edges, vertices)
        )
        p, a, b = self._apart(*shapely.STRtree(tree).query(swept))
        found = most
        for root in turning_points(uv[[a, b, p]], move[[a, b, p]]):
            kept = np.flatnonzero(root < found)
            x, y, z = (uv[v[kept]] + root[kept, None] * move[v[kept]] for v in (p, a, b))
            meets = ((x - y) * (x - z)).sum(axis=1) <= 0
            found = min([found, *root[kept[meets]]])
        return found

    def _apart(self, edge: IntArray, row: IntArray) -> tuple[IntArray, IntArray, IntArray]:
        """The vertex and the two ends of each pair of an edge and a vertex that is not at it."""
        p, a, b = self.start[row], self.start[edge], self.end[edge]
        apart = (p != a) & (p != b)
        return p[apart], a[apart], b[apart]


def turning_points(corners: FloatArray, move: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(n,), (n,) the steps at which triangles that move have no area; inf for none ahead.

    Args:
        corners: (3, n, 2) their corners.
        move: (3, n, 2) how each corner moves in a step of 1.
    """
    first, second = corners[1] - corners[0], corners[2] - corners[0]
    moved_first, moved_second = move[1] - move[0], move[2] - move[0]
    a = cross(moved_first, moved_second)
    b = cross(first, moved_second) + cross(moved_first, second)
    c = cross(first, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -(b + np.copysign(np.sqrt(b * b - 4 * a * c), b)) / 2
        one, other = (np.where(root > 0, root, np.inf) for root in (q / a, c / q))
    return one, other


class Energy:
    """The symmetric Dirichlet energy, its mean over the area, and the boundary's barrier."""

    def __init__(self, disk: Domain, reach: float) -> None:
        self.faces = disk.faces
        frame = frames(disk.vertices, disk.faces)
        weight = 1 / np.abs(np.linalg.det(frame))
        self.weight = weight / weight.sum()
        self.boundary = Boundary(disk, reach)
        # The derivative along x of all triangles, then along y: (2 F, V).
        at = np.concatenate([-frame.sum(axis=1, keepdims=True), frame], axis=1)
        row = np.arange(2 * len(self.faces)).reshape(2, -1, 1)
        ends = np.broadcast_arrays(row, self.faces)
        entries = at.transpose(2, 0, 1).reshape(-1), tuple(end.reshape(-1) for end in ends)
        self.gradient = sparse.coo_array(entries, (row.size, len(disk.vertices))).tocsr()
        self.transposed = self.gradient.T.tocsr()

    def of(self, uv: FloatArray) -> tuple[float, FloatArray, float]:
        """Distortion and barrier together, their (V, 2) gradient, and the distortion alone."""
        jacobian = self.gradient @ uv
        (p, q), (r, s) = jacobian.reshape(2, -1, 2).transpose(2, 0, 1)
        det = p * s - q * r
        if not (det > 0).all():
            return math.inf, uv, math.inf
        squares = p * p + q * q + r * r + s * s
        # |J|² (1 + det⁻²) is s1² + s2² + s1⁻² + s2⁻².
        both = 1 + det**-2
        distortion = float(self.weight @ (squares * both))
        cofactor = np.stack([np.concatenate([s, -r]), np.concatenate([-q, p])], axis=1)
        shares = np.tile(self.weight * np.stack([both, squares / det**3]), 2)[:, :, None]
        barrier, slope = self.boundary.barrier(uv)
        slope += self.transposed @ (2 * (shares[0] * jacobian - shares[1] * cofactor))
        return distortion + barrier, slope, distortion

    def largest_step(self, uv: FloatArray, move: FloatArray) -> float:
        """The largest step along `move`, 1 at most, short of a flip or a contact."""
        corners = self.faces.T
        step = min([1 / SHORT_OF_CONTACT, *map(np.min, turning_points(uv[corners], move[corners]))])
        return SHORT_OF_CONTACT * self.boundary.largest_step(uv, move, step)
