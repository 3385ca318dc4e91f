"""Conformance suite for methods: `check_method` holds one to every promise of the protocol."""

from __future__ import annotations

import json
import pickle
import time
from dataclasses import asdict, is_dataclass
from typing import Any, cast

import numpy as np
from scipy.spatial import ConvexHull, cKDTree

from parapoint.method import REQUIREMENTS, Method, MissingError, UnsupportedError
from parapoint.surfaces.cutting import cut_along, disk_cut
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, PointCloud, Surface

SEED = 7
"""Seed of the methods and of the surfaces that they are checked on."""
SIMILARITIES = ((5e5, 1e-6), (6e6, 1e6))
"""Shifts, in sizes of the surface, and scales of the similar surfaces that are tried."""
STRAY = 1e6
"""How far away, in sizes of the surface, a vertex lies that belongs to no face."""
ALIKE = 1e-3
"""Most that a measure of the map of a similar surface differs by; more only if seeds do."""
OTHER_SEEDS = (1, 2, 3)
"""Seeds that show how much the maps of a method differ by seed alone."""
SEEDS_APART = 2.0
"""Factor on the range of the measures over a few seeds, since other seeds may differ by more."""
THINNEST = 1e-9
"""Ratio of a map's width to its length up to which it counts as collapsed to a line."""


class BrokenPromiseError(AssertionError):
    """A method breaks a promise of the protocol; the message says which, and on which surface."""


def check_method(method: Method, surface: Surface | None = None) -> None:
    """Hold a method to the protocol, on tiny surfaces (under 200 vertices each).

    - It is a dataclass, its parameters and its report can be written as JSON, it can be pickled.
    - `requires` has known words only and is honest: what it admits is parameterized (as
      `parapoint.surfaces.preparation` hands it over); a method that needs faces raises on a point
      cloud.
    - The map has the type for the surface, is finite and not collapsed to a line, and its faces and
      corners are in the order of the mesh.
    - The same seed gives the same map, bit by bit, unless the method says that it is not
      `deterministic`. The arrays of the surface do not change.
    - A surface that is similar (far from the origin, in another unit), or that has one more vertex,
      far away and in no face, gets a map that is alike: lengths and areas differ by ALIKE at most,
      or by what seeds make them differ.
    - A trace counts up in steps and seconds, these from the start of the method, and its maps are
      finite and of the result's shape.

    Args:
        method: what is checked.
        surface: one surface to check it on, in place of the tiny ones; an unsupported one is fine.

    Raises:
        BrokenPromiseError: a promise is broken; the message says which, and on which surface.
        MissingError: a package or program that the method needs is not there.
        UnsupportedError: nothing could be checked, as the method refuses every surface.
    """
    name = type(method).__name__
    _check_declaration(method, name)
    surfaces = sample_surfaces() if surface is None else {"the surface": surface}
    refusal: UnsupportedError | None = None
    checked = 0
    for title, sample in surfaces.items():
        where = f"{name} on {title}"
        try:
            preparation = prepared(sample, method.requires)
        except UnsupportedError as error:
            refusal = error
            if isinstance(sample, PointCloud):
                _check_refusal(method, sample, where)
            continue
        try:
            maps = [_check_run(method, part, where) for part in preparation.parts]
            if not checked and getattr(method, "deterministic", True):
                _check_repeat(method, preparation.parts[0], maps[0], where)
            if not checked:
                _check_similar(method, preparation.parts[0], maps[0], where)
        except MissingError:
            raise
        except UnsupportedError as error:
            refusal = error
            if checked:
                raise BrokenPromiseError(f"{where}: refused, though it meets `requires`") from error
            continue
        checked += 1
    if not checked and refusal is not None:
        raise refusal


def sample_surfaces() -> dict[str, Surface]:
    """The surfaces of `check_method` by title."""
    disk = irregular_disk()
    # A slit from the boundary inwards leaves a disk with duplicate vertices.
    slit = cut_along(disk, np.array([[36, 37], [37, 38], [38, 39]]))
    unreferenced = np.array([[9.0, 9.0, 9.0]])
    littered = Mesh(np.concatenate([unreferenced, slit.vertices, unreferenced]), slit.faces + 1)
    inside = np.abs(disk.vertices[:, :2]).max(axis=1) < 0.4
    holed = Mesh(disk.vertices, disk.faces[~inside[disk.faces].all(axis=1)])
    two = Mesh(
        np.concatenate([disk.vertices, disk.vertices + np.array([3.0, 0.0, 0.0])]),
        np.concatenate([disk.faces, disk.faces + len(disk.vertices)]),
    )
    ball = sphere()
    seamed = Mesh(ball.vertices, ball.faces, ball.edges[disk_cut(ball)])
    plane = np.random.default_rng(SEED).uniform(-1, 1, (160, 2))
    return {
        "a disk of irregular triangles": disk,
        "a disk with unreferenced and duplicate vertices": littered,
        "a disk with a hole": holed,
        "a sphere with seams": seamed,
        "two components": two,
        "a defective mesh": defective(),
        "a point cloud": PointCloud(np.column_stack([plane, 0.3 * plane[:, 0] ** 2])),
    }


def irregular_disk() -> Mesh:
    """A saddle over a square of 9 x 9 vertices, inner ones moved by up to 0.3 of their spacing.

    Vertex 9 i + j stands in row i, column j.
    """
    steps = np.linspace(-1, 1, 9)
    xy = np.stack(np.meshgrid(steps, steps), axis=-1)
    xy[1:-1, 1:-1] += np.random.default_rng(SEED).uniform(-0.075, 0.075, (7, 7, 2))
    x, y = xy.reshape(-1, 2).T
    corner = np.arange(81).reshape(9, 9)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    return Mesh(np.stack([x, y, 0.4 * (x**2 - y**2)], axis=1), faces)


def sphere() -> Mesh:
    """The convex hull of 90 points on a spiral around the unit sphere, faces outward."""
    count = np.arange(90)
    z = 1 - (2 * count + 1) / 90
    angle = np.pi * (3 - np.sqrt(5)) * count
    radius = np.sqrt(1 - z**2)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    faces: IntArray = ConvexHull(points).simplices.astype(np.int64)
    inward = np.linalg.det(points[faces]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)


def defective() -> Mesh:
    """`sphere` with a fin on an edge, a copy of a face, one without area, and faces turned over."""
    whole = sphere()
    a, b, c = whole.faces[0]
    added = np.array([[a, b, len(whole.vertices)], [b, c, a], [a, b, b]])
    faces = np.concatenate([added, whole.faces])
    faces[7::9] = faces[7::9, ::-1]
    return Mesh(np.concatenate([whole.vertices, 1.5 * whole.vertices[[a]]]), faces)


def _check_declaration(method: Method, name: str) -> None:
    """The class is as the protocol says."""
    _promise(is_dataclass(method), f"{name}: is no dataclass")
    _promise(not isinstance(method, type), f"{name}: give a method, not its class")
    _promise(isinstance(method.requires, frozenset), f"{name}: requires is no frozenset")
    unknown = sorted(method.requires - REQUIREMENTS.keys())
    known = sorted(REQUIREMENTS)
    _promise(not unknown, f"{name}: requires unknown words {unknown}; known: {known}")
    parameters = asdict(cast("Any", method))
    _check_json(parameters, f"{name}: its parameters")
    try:
        copy = pickle.loads(pickle.dumps(method))  # noqa: S301 (our own bytes)
    except Exception as error:
        raise BrokenPromiseError(f"{name}: cannot be pickled: {error}") from error
    _promise(asdict(copy) == parameters, f"{name}: pickling changes its parameters")


def _check_json(value: object, what: str) -> None:
    """`value` can be written as JSON."""
    try:
        json.dumps(value)
    except (TypeError, ValueError) as error:
        raise BrokenPromiseError(f"{what} cannot be written as JSON: {error}") from error


def _check_refusal(method: Method, surface: Surface, where: str) -> None:
    """The method raises on what its `requires` refuses."""
    try:
        method.parameterize(surface, seed=SEED)
    except Exception:  # noqa: BLE001 (any error is a refusal; only silence is not)
        return
    raise BrokenPromiseError(f"{where}: returned a map, though `requires` refuses this surface")


def _check_run(
    method: Method, surface: Surface, where: str
) -> Parameterization | PointParameterization:
    """The map of a surface that the method admits, checked."""
    before = _arrays(surface)
    begun = time.perf_counter()
    result = method.parameterize(surface, seed=SEED)
    seconds = time.perf_counter() - begun
    for name, array in _arrays(surface).items():
        _promise(np.array_equal(array, before[name]), f"{where}: changed the surface's {name}")
    if isinstance(surface, Mesh):
        if not isinstance(result, Parameterization):
            returned = type(result).__name__
            raise BrokenPromiseError(
                f"{where}: returned {returned}; a mesh needs a Parameterization"
            )
        _check_corners(surface, result, where)
    else:
        if not isinstance(result, PointParameterization):
            returned = type(result).__name__
            raise BrokenPromiseError(
                f"{where}: returned {returned}; a cloud needs a PointParameterization"
            )
        shape = (len(surface.points), 2)
        found = result.uv.shape
        _promise(found == shape, f"{where}: uv has shape {found}, not {shape}")
    known = result.uv[np.isfinite(result.uv).all(axis=1)]
    _promise(len(known) > 0, f"{where}: the map leaves everything out")
    spread = np.linalg.svd(known - known.mean(axis=0), compute_uv=False)
    wide = bool(spread[1] > THINNEST * spread[0])
    _promise(wide, f"{where}: the map collapsed to a line or a point")
    _check_trace(result, seconds, where)
    _check_json(dict(result.report), f"{where}: the report")
    return result


def _arrays(surface: Surface) -> dict[str, FloatArray | IntArray]:
    """Copies of the arrays of a surface by name."""
    if isinstance(surface, Mesh):
        return {"vertices": surface.vertices.copy(), "faces": surface.faces.copy()}
    arrays: dict[str, FloatArray | IntArray] = {"points": surface.points.copy()}
    if surface.normals is not None:
        arrays["normals"] = surface.normals.copy()
    return arrays


def _check_corners(mesh: Mesh, result: Parameterization, where: str) -> None:
    """One row of corners a face, and no row of uv for two places of the surface."""
    shape = mesh.faces.shape
    found = result.corners.shape
    _promise(found == shape, f"{where}: corners have shape {found}, the faces {shape}")
    place = mesh.vertices[mesh.faces].reshape(-1, 3)
    row = result.corners.reshape(-1)
    last = np.zeros((len(result.uv), 3))
    last[row] = place
    _promise(
        np.array_equal(last[row], place),
        f"{where}: a row of uv serves corners at different places: "
        "faces or corners are not in the order of the mesh",
    )


def _check_trace(
    result: Parameterization | PointParameterization, seconds: float, where: str
) -> None:
    """The trace counts up within the seconds that the method took, and its maps fit the result."""
    for name, values in (
        ("iterations", [point.iteration for point in result.trace]),
        ("seconds", [point.seconds for point in result.trace]),
    ):
        _promise(values == sorted(values), f"{where}: the {name} of the trace go back")
    within = all(0 <= point.seconds <= seconds for point in result.trace)
    _promise(within, f"{where}: the seconds of the trace are not those since the method began")
    for point in result.trace:
        if point.uv is not None:
            fits = point.uv.shape == result.uv.shape and np.isfinite(point.uv).all()
            which = f"the map at iteration {point.iteration} of the trace"
            _promise(bool(fits), f"{where}: {which} is not one")


def _check_repeat(
    method: Method,
    surface: Surface,
    first: Parameterization | PointParameterization,
    where: str,
) -> None:
    """The same seed gives the same map."""
    second = method.parameterize(surface, seed=SEED)
    same = np.array_equal(first.uv, second.uv, equal_nan=True)
    if isinstance(first, Parameterization) and isinstance(second, Parameterization):
        same = same and np.array_equal(first.corners, second.corners)
    _promise(same, f"{where}: another map under the same seed")


def _promise(kept: bool, otherwise: str) -> None:
    """Hold a method to one promise; unlike `assert`, this does so under `python -O` as well.

    Raises:
        BrokenPromiseError: the promise is not kept; the message is `otherwise`.
    """
    if not kept:
        raise BrokenPromiseError(otherwise)


def _check_similar(
    method: Method,
    surface: Surface,
    first: Parameterization | PointParameterization,
    where: str,
) -> None:
    """The map of a similar surface is alike, wherever it lies, in any unit."""
    known = measures(surface, first)
    cases: dict[str, Surface] = {
        f"moved by {shift:g} times its size and scaled by {scale:g}": similar(surface, shift, scale)
        for shift, scale in SIMILARITIES
    }
    if isinstance(surface, Mesh) and surface.seams is None:
        far = surface.vertices[:1] + STRAY * float(np.ptp(surface.vertices, axis=0).max())
        cases["with a far vertex of no face"] = Mesh(
            np.concatenate([surface.vertices, far]), surface.faces
        )
    for how, moved in cases.items():
        what = f"{where}: {how}, it"
        try:
            found = method.parameterize(moved, seed=SEED)
        except MissingError:
            raise
        except Exception as error:
            raise BrokenPromiseError(f"{what} cannot be mapped: {error}") from error
        apart = float(np.abs(measures(surface, found) - known).max())
        if apart > ALIKE:
            others = [method.parameterize(surface, seed=seed) for seed in OTHER_SEEDS]
            by_seed = np.ptp([known, *(measures(surface, other) for other in others)], axis=0)
            _promise(
                apart <= SEEDS_APART * float(by_seed.max()),
                f"{what} has another map: lengths or areas differ by {apart:.2g}",
            )


def similar(surface: Surface, shift: float, scale: float) -> Surface:
    """The surface moved by `shift` times its size along each axis, then scaled."""
    points = surface.vertices if isinstance(surface, Mesh) else surface.points
    moved = scale * (points + shift * float(np.ptp(points, axis=0).max()))
    if isinstance(surface, Mesh):
        return Mesh(moved, surface.faces, surface.seams)
    return PointCloud(moved, surface.normals, surface.dropped, surface.attributes)


def measures(surface: Surface, result: Parameterization | PointParameterization) -> FloatArray:
    """(2,) how unevenly a map changes lengths and signed areas, whatever the unit of either side.

    The sums of absolute differences between the shares that edges, and faces, have of the whole on
    the surface and in the plane: 0 where all shares stay, 2 at most but for flipped faces. The
    edges of a cloud lead to its six nearest neighbours; it has no faces. Faces that the map leaves
    out do not count.
    """
    if isinstance(result, PointParameterization):
        assert isinstance(surface, PointCloud)
        near = cKDTree(surface.points).query(surface.points, 7)[1][:, 1:]
        lengths = [
            np.linalg.norm(of[near] - of[:, None], axis=2) for of in (surface.points, result.uv)
        ]
        return np.array([_share_difference(*lengths), 0.0])
    assert isinstance(surface, Mesh)
    known = result.covered
    corners = surface.vertices[surface.faces[known]], result.uv[result.corners[known]]
    lengths = [np.linalg.norm(of - np.roll(of, 1, axis=1), axis=2) for of in corners]
    (ax, ay), (bx, by) = ((corners[1][:, k] - corners[1][:, 0]).T for k in (1, 2))
    turned = ax * by - ay * bx
    turned *= np.sign(turned.sum()) or 1.0
    return np.array(
        [_share_difference(*lengths), _share_difference(surface.face_areas[known], turned)]
    )


def _share_difference(one: FloatArray, other: FloatArray) -> float:
    total = np.abs(other).sum()
    return float(np.abs(one / one.sum() - other / (total or 1.0)).sum())
