"""`python -m benchmarks bake`: colours of held-out points, read back from baked textures.

A model is sampled, and the samples are coloured by sums of waves through space. The cloud becomes a
textured mesh in two ways: by the computed map, and as is usual today, by a mesh that MeshLab
reconstructs, an atlas that xatlas makes, and the colour of the nearest point at each texel. Points
that neither has seen are then projected onto the mesh, and read their colours from the texture.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any, NamedTuple, Protocol, cast

import igl
import numpy as np
from rich.table import Table
from scipy.spatial import cKDTree

from baselines.registry import method
from benchmarks.cases.models import load
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.sampling import surface_sample
from parapoint.surfaces.surface import FloatArray, Mesh, PointCloud
from parapoint.textures.baking import Pixels, baked
from parapoint.textures.placing import Placing
from parapoint.textures.texels import texels

CASES = ("spot_c3d", "max_planck_i_f8000", "camelhead", "fertility")
"""Models that are sampled: two closed ones, a disk, and one with handles."""
OURS = "computed(time_budget=60)"
"""The method whose own bake is measured."""
TODAY = tuple(
    f"meshed(reconstruction={reconstruction}, flattening=xatlas)"
    for reconstruction in ("poisson", "ball_pivoting")
)
WAVES = {"smooth": 5.0, "fine": 20.0}
"""For each kind of colours, the most waves along the longest side of a model's bounding box."""
POINTS, HELD_OUT, TEXELS = 50_000, 20_000, 2048
"""Points that the texture is baked from, points that test it, and texels along a side."""
WAVE_COUNT = 12
"""Number of waves that are summed."""


class Baking(NamedTuple):
    """One measured row.

    Attributes:
        case: the model.
        colours: "smooth" or "fine".
        method: what made the mesh and its map.
        psnr: peak signal-to-noise ratio of the held-out points' colours, in decibels.
        seconds: processor time of the bake alone.
        reason: why there is no result; "" if there is one.
    """

    case: str
    colours: str
    method: str
    psnr: float
    seconds: float
    reason: str


class MakesTexturedMeshes(Protocol):
    """A method that makes a mesh of a cloud, with a map of the mesh."""

    def charted(self, surface: PointCloud, *, seed: int) -> Charted:
        """The mesh and its map."""
        ...


def bakings(cases: tuple[str, ...] = CASES, points: int = POINTS) -> Iterator[Baking]:
    """The rows of the table, each as soon as it is measured.

    Raises:
        InputError: a case is not a mesh, or is unknown.
    """
    for case in cases:
        mesh = load(case)
        if not isinstance(mesh, Mesh):
            raise InputError(f"{case}: is a cloud; clouds with known colours are made of meshes")
        side = float(np.ptp(mesh.vertices[mesh.referenced], axis=0).max())
        seen = surface_sample(mesh.vertices, mesh.faces, points, 0)
        unseen = surface_sample(mesh.vertices, mesh.faces, HELD_OUT, 1)
        for spec in (OURS, *TODAY):
            made = cast("MakesTexturedMeshes", method(spec)[1])
            try:
                charted = made.charted(PointCloud(seen), seed=0)
            except RuntimeError as error:
                reason = str(error)
                yield from (Baking(case, how, spec, np.nan, np.nan, reason) for how in WAVES)
                continue
            charted = Placing.smallest(charted.map.uv).of(charted)
            for how, waves in WAVES.items():
                colours = np.rint(255 * wave_colours(seen / side, waves)).astype(np.uint8)
                cloud = PointCloud(seen, attributes={"colours": colours})
                begun = time.process_time()
                texture = (
                    baked(charted, cloud, "colour", TEXELS).pixels
                    if spec == OURS
                    else nearest_baked(charted, cloud, TEXELS)
                )
                seconds = time.process_time() - begun
                read = looked_up(charted, texture, unseen)
                error_of = read - wave_colours(unseen / side, waves)
                psnr = -10 * np.log10(float((error_of**2).mean()))
                yield Baking(case, how, spec, psnr, seconds, "")


def wave_colours(points: FloatArray, waves: float) -> FloatArray:
    """(N, 3) colours from 0 to 1: sums of plane waves, with at most `waves` in a unit of length."""
    rng = np.random.default_rng(0)
    towards = rng.normal(size=(WAVE_COUNT, 3))
    towards *= (
        waves
        * rng.uniform(0.3, 1, (WAVE_COUNT, 1))
        / np.linalg.norm(towards, axis=1, keepdims=True)
    )
    phase = rng.uniform(0, 2 * np.pi, WAVE_COUNT)
    strength = rng.normal(size=(WAVE_COUNT, 3)) / 8
    return np.asarray(
        np.clip(0.5 + np.sin(2 * np.pi * points @ towards.T + phase) @ strength, 0, 1)
    )


def nearest_baked(charted: Charted, cloud: PointCloud, size: int) -> Pixels:
    """(size, size, 3) a texture in which each texel has the colour of the nearest point."""
    shown = texels(charted, size)
    corners = charted.mesh.vertices[charted.mesh.faces[shown.faces]]
    places = np.einsum("nc,ncd->nd", shown.weights(slice(None)), corners)
    pixels = np.zeros((size * size, 3), dtype=np.uint8)
    pixels[shown.places] = cloud.attributes["colours"][cKDTree(cloud.points).query(places)[1]]
    return pixels.reshape(size, size, 3)


def looked_up(charted: Charted, texture: Pixels, points: FloatArray) -> FloatArray:
    """(N, 3) colours of the texture, interpolated where the mesh is nearest to each point."""
    mesh, held = charted
    _, face, place = igl.point_mesh_squared_distance(points, mesh.vertices, mesh.faces)
    corners = [np.ascontiguousarray(mesh.vertices[mesh.faces[face, k]]) for k in range(3)]
    share = np.nan_to_num(igl.barycentric_coordinates(np.ascontiguousarray(place), *corners))
    uv = np.einsum("nc,ncd->nd", share, held.uv[held.corners[face]])
    size = len(texture)
    at = np.stack([(1 - uv[:, 1]) * size, uv[:, 0] * size], axis=1) - 0.5
    low = np.floor(at).astype(np.int64)
    part = (at - low)[:, :, None]
    total: Any = 0.0
    for line in (0, 1):
        for column in (0, 1):
            weight = np.abs(1 - line - part[:, 0]) * np.abs(1 - column - part[:, 1])
            row, place_in_row = np.clip(low + np.array([line, column]), 0, size - 1).T
            total = total + weight * texture[row, place_in_row]
    return np.asarray(total / 255)


def table(rows: list[Baking]) -> Table:
    """The rows as a table for the terminal."""
    made = Table("case", "colours", "method", "PSNR [dB]", "bake [s]", title="Bakes")
    for row in rows:
        numbers = [row.reason or f"{row.psnr:.1f}", "" if row.reason else f"{row.seconds:.1f}"]
        made.add_row(row.case, row.colours, row.method, *numbers)
    return made
