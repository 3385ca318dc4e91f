import numpy as np
import pytest

from parapoint.computed.delaunay import delaunay_complex, empty_radii, insideness


def shell(count: int = 600, radius: float = 1.0) -> np.ndarray:
    """A Fibonacci lattice on a sphere."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.arange(count) * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - z**2)
    return radius * np.column_stack([r * np.cos(turn), r * np.sin(turn), z])


def test_empty_balls_are_empty_and_smallest() -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    delaunay = delaunay_complex(points, np.zeros(60))
    triangles, radius = delaunay.triangles, empty_radii(delaunay)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    sides = [np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))]
    circumradius = np.prod(sides, axis=0) / (2 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    assert (radius >= circumradius * (1 - 1e-9)).all()
    # The shortest edges are Delaunay, so the pair of nearest points is in a triangle.
    apart = np.linalg.norm(points[:, None] - points, axis=2) + 9 * np.eye(60)
    pair = set(np.unravel_index(apart.argmin(), apart.shape))
    assert any(pair <= set(row) for row in triangles.tolist())


def test_the_sides_of_a_triangle_are_in_front_and_behind() -> None:
    points = np.random.default_rng(0).normal(size=(60, 3))
    of = delaunay_complex(points, np.zeros(60))
    a, b, c = (of.sites[of.triangles[:, k]] for k in range(3))
    for side, sign in zip(of.sides.T, (1, -1), strict=True):
        offset = of.sites[of.tetrahedra[side]].mean(axis=1) - a
        assert (np.sign((np.cross(b - a, c - a) * offset).sum(axis=1)) == sign).all()


def test_the_space_between_two_shells_is_inside() -> None:
    """A cavity is outside, although no path leads there."""
    points = np.concatenate([shell(900), shell(400, 0.5)])
    of = delaunay_complex(points, np.full(len(points), 0.1))
    inside = insideness(of) > 0
    middle = np.linalg.norm(of.sites[of.tetrahedra].mean(axis=1), axis=1)
    assert inside[(middle > 0.55) & (middle < 0.9)].all()
    assert not inside[(middle < 0.4) | (middle > 1)].any()


def test_a_bowl_has_an_inside_though_it_is_open() -> None:
    points = shell(900)
    points = points[points[:, 2] < 0.8]
    of = delaunay_complex(points, np.full(len(points), 0.1))
    inside = insideness(of) > 0
    middle = of.sites[of.tetrahedra].mean(axis=1)
    assert inside[np.linalg.norm(middle, axis=1) < 0.5].all()


def test_the_centre_of_a_smallest_empty_ball_is_nearest_to_the_triangle() -> None:
    # The centres of balls through a triangle's corners lie on a line through its circumcentre m, at
    # height t, with radius² = R² + t². A ball that reaches the apex p of the tetrahedron on one
    # side has t = (|p − m|² − R²) / 2 n·(p − m); between the t of both sides the balls are empty.
    points = np.random.default_rng(0).normal(size=(60, 3))
    of = delaunay_complex(points, np.zeros(60))
    found = empty_radii(of)
    is_beside = np.zeros(len(found), dtype=bool)
    for row, (triangle, sides) in enumerate(zip(of.triangles, of.sides, strict=True)):
        a, b, c = of.sites[triangle]
        normal = np.cross(b - a, c - a)
        unit = normal / np.linalg.norm(normal)
        equal = np.array([b - a, c - a, unit])
        middle = np.linalg.solve(equal, [(b @ b - a @ a) / 2, (c @ c - a @ a) / 2, unit @ a])
        squared = (a - middle) @ (a - middle)
        heights = []
        for side in sides:
            (apex,) = np.setdiff1d(of.tetrahedra[side], triangle)
            p = of.sites[apex] - middle
            heights.append((p @ p - squared) / (2 * unit @ p))
        nearest = np.clip(0.0, min(heights), max(heights))
        is_beside[row] = nearest != 0
        assert found[row] == pytest.approx(np.sqrt(squared + nearest**2), rel=1e-6)
    assert is_beside.any()
    assert not is_beside.all()
