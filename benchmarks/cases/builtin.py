"""Surfaces made in memory: the default cases that need no download, with answers known exactly.

All are manifold and consistently oriented, and the same on every machine. Each takes a resolution,
so that a test can refine it; `BUILTIN` holds the sizes that the benchmark uses.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import igl
import numpy as np
from scipy.spatial import Delaunay

from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, PointCloud

HALF_CYLINDER_LENGTH, CONE_HEIGHT = 3.0, 2.0
"""In radii of the cylinder and of the cone's base."""
WAVE_HEIGHT = 0.1
"""In sides of the square that is waved."""
ROLL_HEIGHT, ROLL_TURNS = 4.0, (1.0, 2.5)
"""Of the spiral (t cos t, t sin t): its height in the unit of t, and the turns between its ends."""
TORUS_RADII = (1.0, 0.4)
"""Of the ring and of its tube."""
SAMPLED_POINTS = 8_000
"""Points of a built-in cloud."""
DENSITY_RATIO = 10.0
"""Density of the dense side of an uneven cloud over that of the thin one."""


def grid_faces(rows: int, columns: int) -> IntArray:
    """(F, 3) triangles of a grid of vertices, row by row; every second diagonal is turned."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    turned = (np.add.outer(np.arange(rows - 1), np.arange(columns - 1)) % 2).astype(bool)
    first = np.where(turned[..., None], np.stack([a, b, d], 2), np.stack([a, b, c], 2))
    second = np.where(turned[..., None], np.stack([b, c, d], 2), np.stack([a, c, d], 2))
    return np.stack([first, second], axis=2).reshape(-1, 3)


def disk_points(rings: int) -> tuple[FloatArray, IntArray]:
    """(V, 2) points of the unit disk, ring k of 6k points at radius k / rings, and its triangles.

    All triangles are of about one size, and the edge length is about 1 / rings.
    """
    ring = np.repeat(np.arange(rings + 1), np.maximum(6 * np.arange(rings + 1), 1))
    first = 1 + 3 * np.arange(rings + 1) * np.arange(-1, rings)  # of the points of each ring
    first[0] = 0
    angle = 2 * np.pi * (np.arange(len(ring)) - first[ring]) / np.maximum(6 * ring, 1)
    faces = []
    for k in range(1, rings + 1):
        outer, inner = first[k], first[k - 1]
        n, m = 6 * k, max(6 * (k - 1), 1)
        for sector in range(6):
            for step in range(k):
                at, below = sector * k + step, sector * (k - 1) + step
                faces.append((outer + at, outer + (at + 1) % n, inner + below % m))
                if step < k - 1:
                    faces.append((inner + below, outer + at + 1, inner + (below + 1) % m))
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * (ring / rings)[:, None]
    return points, np.array(faces, dtype=np.int64)


def half_cylinder(resolution: int = 24) -> Mesh:
    """Half of a cylinder of radius 1 and length 3, open on all sides.

    Developable: unrolled, it is a rectangle of pi x 3 (of 2 n sin(pi / 2n) x 3 as triangulated,
    with n facets around), so an isometry exists. Area 3 pi in the limit.
    """
    angle = np.linspace(0, np.pi, resolution + 1)
    height = np.linspace(0, HALF_CYLINDER_LENGTH, resolution + 1)
    a, z = np.meshgrid(angle, height, indexing="ij")
    points = np.stack([np.cos(a), np.sin(a), z], axis=2).reshape(-1, 3)
    return Mesh(points, grid_faces(resolution + 1, resolution + 1))


def cone(resolution: int = 16) -> Mesh:
    """Cone of radius 1 and height 2 without its base, the apex a vertex.

    All curvature, 2 pi (1 - sin(half angle)), is at the apex; elsewhere it is developable. With
    the distance r from the apex and k = sin(half angle) = 1 / sqrt(5), the map (r, t) ->
    (r^(1/k), t) in polar coordinates is conformal. Area pi sqrt(5) in the limit.
    """
    around = 3 * resolution
    t, r = np.meshgrid(
        2 * np.pi * np.arange(around) / around,
        np.arange(1, resolution + 1) / resolution,
        indexing="xy",
    )
    rings = np.stack([r * np.cos(t), r * np.sin(t), CONE_HEIGHT * (1 - r)], axis=2)
    points = np.concatenate([[[0.0, 0.0, CONE_HEIGHT]], rings.reshape(-1, 3)])
    index = np.arange(1, len(points)).reshape(resolution, around)
    index = np.concatenate([index, index[:, :1]], axis=1)
    tip = np.stack([np.zeros(around, dtype=np.int64), index[0, :-1], index[0, 1:]], axis=1)
    sides = index.reshape(-1)[grid_faces(resolution, around + 1)]
    return Mesh(points, np.concatenate([tip, sides]))


def sphere_cap(degrees: float, rings: int = 16) -> Mesh:
    """Cap of the unit sphere around the north pole, down to a polar angle of `degrees`.

    Stereographic projection from the south pole, 2 tan(polar / 2) along each meridian, is
    conformal; Lambert's, 2 sin(polar / 2), keeps areas and has singular values of ratio
    1 / cos^2(polar / 2). Area 2 pi (1 - cos(degrees)) in the limit.
    """
    disk, faces = disk_points(rings)
    radius = np.linalg.norm(disk, axis=1)
    polar = np.deg2rad(degrees) * radius
    across = disk * (np.sin(polar) / np.where(radius > 0, radius, 1))[:, None]
    return Mesh(np.column_stack([across, np.cos(polar)]), faces)


def saddle(resolution: int = 24) -> Mesh:
    """The graph z = x^2 - y^2 over [-1, 1]^2, of curvature -4 / (1 + 4 r^2)^2."""
    side = np.linspace(-1, 1, resolution + 1)
    x, y = (values.reshape(-1) for values in np.meshgrid(side, side, indexing="ij"))
    return Mesh(np.stack([x, y, x**2 - y**2], axis=1), grid_faces(resolution + 1, resolution + 1))


def wavy_sheet(resolution: int = 24) -> Mesh:
    """The graph z = 0.1 sin(2 pi x) sin(2 pi y) over the unit square, in very unequal triangles.

    The points are random and lie about twice as close at one side as at the other; a method whose
    map follows the triangles and not the surface is shown up by it.
    """
    rng = np.random.default_rng(20240315)  # any seed; it names these very triangles
    inner = rng.uniform(0.02, 0.98, size=((resolution - 1) ** 2, 2))
    side = np.linspace(0, 1, resolution + 1)[:-1]
    zero, one = np.zeros(resolution), np.ones(resolution)
    edge = np.concatenate(
        [
            np.column_stack(pair)
            for pair in ((side, zero), (one, side), (1 - side, one), (zero, 1 - side))
        ]
    )
    flat = np.concatenate([edge, inner])
    flat[:, 0] = (flat[:, 0] + 0.6 * flat[:, 0] ** 2) / 1.6  # denser towards x = 0
    faces = Delaunay(flat).simplices.astype(np.int64)
    u, v = flat[faces[:, 1]] - flat[faces[:, 0]], flat[faces[:, 2]] - flat[faces[:, 0]]
    area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    faces[area < 0] = faces[area < 0][:, ::-1]
    height = WAVE_HEIGHT * np.sin(2 * np.pi * flat[:, 0]) * np.sin(2 * np.pi * flat[:, 1])
    return Mesh(np.column_stack([flat, height]), faces)


def swiss_roll(resolution: int = 24) -> Mesh:
    """Archimedean spiral (t cos t, t sin t) for 1 to 2.5 turns, drawn out to a height of 4.

    Developable: unrolled, it is a rectangle of its arc length, (t sqrt(1 + t^2) + arsinh t) / 2
    between the ends, by 4. The layers lie 2 pi apart: near in space, far along the surface.
    """
    t = 2 * np.pi * np.linspace(*ROLL_TURNS, 3 * resolution + 1)
    height = np.linspace(0, ROLL_HEIGHT, resolution // 2 + 1)
    a, z = np.meshgrid(t, height, indexing="ij")
    points = np.stack([a * np.cos(a), a * np.sin(a), z], axis=2).reshape(-1, 3)
    return Mesh(points, grid_faces(len(t), len(height)))


def sphere(subdivisions: int = 3) -> Mesh:
    """Closed unit sphere, an icosahedron subdivided. Area 4 pi in the limit."""
    from trimesh.creation import icosphere

    ball = icosphere(subdivisions=subdivisions)
    return Mesh(ball.vertices, ball.faces)


def torus(resolution: int = 24) -> Mesh:
    """Closed torus of radii 1 and 0.4. Area 4 pi^2 x 0.4 in the limit."""
    large, small = TORUS_RADII
    around, across = 2 * resolution, resolution
    t, s = np.meshgrid(
        2 * np.pi * np.arange(around) / around,
        2 * np.pi * np.arange(across) / across,
        indexing="ij",
    )
    ring = large + small * np.cos(s)
    points = np.stack([ring * np.cos(t), ring * np.sin(t), small * np.sin(s)], axis=2)
    index = np.arange(around * across).reshape(around, across)
    closed = np.pad(index, ((0, 1), (0, 1)), mode="wrap")
    return Mesh(points.reshape(-1, 3), closed.reshape(-1)[grid_faces(around + 1, across + 1)])


def sampled(
    mesh: Mesh, *, noise: float = 0.0, is_uneven: bool = False, count: int = SAMPLED_POINTS
) -> tuple[PointCloud, PointCloud]:
    """A cloud sampled from a mesh at random, always the same, and where its points belong.

    A noisy point belongs at the nearest place of the mesh: from where it was drawn the noise has
    moved it along the surface too, which no map can know.

    Args:
        mesh: what is sampled, by area.
        noise: standard deviation of the normal noise on each coordinate, as a fraction of the
            diagonal of the mesh's box.
        is_uneven: whether the density falls tenfold from one end of the longest axis of the mesh to
            the other, at an even rate.
        count: number of points.
    """
    rng = np.random.default_rng(20240316)  # any seed; it names these very points
    corners = mesh.vertices[mesh.faces]
    weight = mesh.face_areas
    if is_uneven:
        centred = corners.mean(axis=1) - corners.mean(axis=(0, 1))
        along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
        along *= 1.0 if along.max() > -along.min() else -1.0  # the sign of an SVD is free
        weight = weight * DENSITY_RATIO ** ((along - along.min()) / np.ptp(along))
    face = rng.choice(len(corners), count, p=weight / weight.sum())
    u, v = rng.random((2, count))
    inside = u + v <= 1
    u, v = np.where(inside, u, 1 - u), np.where(inside, v, 1 - v)
    first, second, third = corners[face].transpose(1, 0, 2)
    drawn = first + u[:, None] * (second - first) + v[:, None] * (third - first)
    if noise == 0:
        return PointCloud(drawn), PointCloud(drawn)
    scale = noise * float(np.linalg.norm(np.ptp(mesh.vertices[mesh.referenced], axis=0)))
    noisy = drawn + scale * rng.standard_normal(drawn.shape)
    nearest = igl.point_mesh_squared_distance(noisy, mesh.vertices, mesh.faces)[2]
    return PointCloud(noisy), PointCloud(nearest)


BUILTIN: dict[str, Callable[[], Mesh]] = {
    "half_cylinder": half_cylinder,
    "cone": cone,
    "sphere_cap_45": partial(sphere_cap, 45),
    "sphere_cap_90": partial(sphere_cap, 90),
    "sphere_cap_150": partial(sphere_cap, 150),
    "saddle": saddle,
    "wavy_sheet": wavy_sheet,
    "swiss_roll": swiss_roll,
    "sphere": sphere,
    "torus": torus,
}
"""The built-in cases: name -> a function that makes the mesh."""


def finger() -> Mesh:
    """A disk with a long finger at its middle, which maps starve where no seam leads to it."""
    points, faces = disk_points(14)
    away = np.linalg.norm(points, axis=1)
    near = away < 0.5
    radius = np.where(near, np.minimum(away, 0.15), 0.15 + (away - 0.5) * 1.7)
    height = np.where(near, 6 * (0.5 - away), 0)
    plane = points * (radius / np.maximum(away, 1e-9))[:, None]
    return Mesh(np.column_stack([plane, height]), faces)
