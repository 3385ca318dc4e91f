"""Clouds as scanners and drivers write them, family by family; see `benchmarks.checks.wild`."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import laspy
import numpy as np

from benchmarks.checks.wild_case import POINTS, SEED, Case, shows
from benchmarks.metrics.evaluation import evaluate
from parapoint.computed.computed_map import ComputedMap
from parapoint.files.reading import read_surface
from parapoint.surfaces.surface import FloatArray, IntArray, PointCloud


def _directions(count: int) -> FloatArray:
    points = np.random.default_rng(SEED).normal(size=(count, 3))
    return np.asarray(points / np.linalg.norm(points, axis=1, keepdims=True))


def _dome(count: int = 400) -> FloatArray:
    points = _directions(count)
    points[:, 2] = np.abs(points[:, 2])
    return points


def strays() -> Iterator[Case]:
    """Clouds whose last rows are flying pixels or stand for missing data."""
    rng = np.random.default_rng(SEED)
    far = _directions(12)
    away = np.array([5e5, 5e6, 100.0])
    for name, points, rows in (
        ("one_30", _dome(), 30 * far[:1]),
        ("some_500", _dome(), 500 * far),
        ("some_million", _dome(), 1e6 * far),
        ("zeros", _dome() + away, np.zeros((20, 3))),
        ("nodata", _dome(), np.full((20, 3), -9999.0)),
        ("clump_30", _dome(), 0.1 * far + [30, 0, 0]),
        ("clumps_30", _dome(), np.concatenate([0.1 * far + 30 * axis for axis in np.eye(3)])),
        ("many_1000", _dome(1000), 1e3 * _directions(200)),
        ("many_million", _dome(1000), 1e6 * _directions(250)),
        ("many_zeros", _dome() + away, np.zeros((300, 3))),
        ("cloud_8", _dome(2000), 0.1 * rng.normal(size=(160, 3)) + [8, 0, 0]),
        ("none", _dome(), np.zeros((0, 3))),
    ):
        data = _text(np.concatenate([points, rows]))
        yield Case(f"{name}.xyz", data, partial(_has_strays, count=len(rows)))


def _text(points: FloatArray) -> bytes:
    return "".join("{} {} {}\n".format(*row) for row in points.tolist()).encode()


def _has_strays(path: Path, count: int) -> bool:
    """Whether this many rows are left out, and all others are on the surface that is found."""
    report = ComputedMap().fit(read_surface(path)).report_
    return report["strays"] == count and report["missed"] == 0


def scan_lines() -> Iterator[Case]:
    """Scan lines much farther apart than the points on them; beyond 1:30 they may be refused."""
    for gap in (1, 8, 12, 20, 30, 100):
        x, y = np.meshgrid(np.arange(120.0), gap * np.arange(8.0))
        x += np.random.default_rng(SEED).uniform(0, 1, (8, 1))
        points = np.stack([x, y, 5 * np.sin(x / 30)], axis=2).reshape(-1, 3)
        # Of short lines so far apart nobody sees the second one: they are a curve.
        is_right, is_curve = partial(_has_strays, count=0), gap > 60
        yield Case(f"lines_{gap}.xyz", _text(points), is_right, is_curve)
    for gap, apart, rings, noise in (
        (12, 0.4, 8, 0),
        (30, 0.4, 4, 0),
        (30, 1, 10, 0.3),
        (60, 0.6, 6, 0.1),
        (15, 0.7, 10, 0.3),
    ):
        for kind, arc, loops in (("rings", 2 * np.pi, 2), ("arcs", 4.0, 1), ("helix", 0, 2)):
            step = apart / gap
            angle, height = np.meshgrid(np.arange(0, arc, step), apart * np.arange(rings))
            if kind == "helix":
                angle = np.arange(0, 2 * np.pi * rings, step)
                height = apart * angle / (2 * np.pi)
            else:
                angle += np.random.default_rng(SEED).uniform(0, step, (rings, 1))
            points = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
            points += noise * step * np.random.default_rng(SEED).normal(size=points.shape)
            is_right = partial(_is_unrolled, loops=loops)
            yield Case(f"{kind}_{gap}_{apart}_{rings}.xyz", _text(points), is_right)


def _is_unrolled(path: Path, loops: int) -> bool:
    """Whether a cylinder is mapped with so many rims and nearly without distortion."""
    model = ComputedMap().fit(read_surface(path))
    found, (mesh, flat) = model.report_["found"], model.mesh()
    assert isinstance(found, dict)
    angles = evaluate(mesh, flat)["quasi_conformal_mean"]
    return found["genus"] == 0 and found["boundary_loops"] == loops and angles < 1.1


def pcd() -> Iterator[Case]:
    """Padding, types, and heads without POINTS, as the drivers of lidars write them."""
    for name, fields, sizes, types, counts, kind in (
        ("plain", "x y z", "4 4 4", "F F F", "1 1 1", "<3f"),
        ("doubles", "x y z", "8 8 8", "F F F", "1 1 1", "<3d"),
        ("turned", "z y x", "4 4 4", "F F F", "1 1 1", "<3f"),
        ("count0", "x y z _", "4 4 4 1", "F F F U", "1 1 1 0", "<3f"),
        ("padded", "x y z _", "4 4 4 1", "F F F U", "1 1 1 5", "<3f5x"),
        ("ring", "x y z ring", "4 4 4 2", "F F F U", "1 1 1 1", "<3f2x"),
    ):
        rows = POINTS[:, ::-1] if name == "turned" else POINTS
        head = f"VERSION .7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {types}\nCOUNT {counts}\n"
        for ends, size in (("points", "WIDTH 3\nHEIGHT 1\nPOINTS 3\n"), ("width", "WIDTH 3\n")):
            data = (head + size + "DATA binary\n").encode()
            data += b"".join(struct.pack(kind, *row) for row in rows.tolist())
            yield Case(f"{name}_{ends}.pcd", data, shows(POINTS))
            old = data.replace(b"FIELDS", b"COLUMNS", 1)  # its name before version 0.7
            yield Case(f"{name}_{ends}_old.pcd", old, shows(POINTS))


def las() -> Iterator[Case]:
    """Noise and withheld points, which are left out, and colours of 8 and 16 bits."""
    colours = np.array([[0, 128, 255], [9, 10, 11], [255, 0, 0], [1, 2, 3], [7, 8, 9]])
    points = np.concatenate([POINTS, [[1e6, 0, 0], [-1e6, 0, 0]]])
    for name, classes, withheld, kept in (
        ("whole", [0, 1, 2, 3, 6], [0] * 5, [0, 1, 2, 3, 4]),
        ("low_noise", [2, 2, 2, 7, 7], [0] * 5, [0, 1, 2]),
        ("high_noise", [2, 2, 2, 18, 18], [0] * 5, [0, 1, 2]),
        ("withheld", [2] * 5, [0, 0, 0, 1, 1], [0, 1, 2]),
        ("noise_and_withheld", [2, 7, 2, 18, 2], [0, 0, 0, 0, 1], [0, 2]),
    ):
        for bits, ending in ((8, ".las"), (16, ".las"), (8, ".laz"), (16, ".laz")):
            values = colours * (257 if bits == 16 else 1)
            cloud = laspy.LasData(laspy.LasHeader(point_format=7, version="1.4"))
            cloud.x, cloud.y, cloud.z = points.T
            cloud.classification, cloud.withheld = np.array(classes), np.array(withheld)
            cloud.red, cloud.green, cloud.blue = values.astype(np.uint16).T
            file = io.BytesIO()
            cloud.write(file, do_compress=ending == ".laz")
            is_right = partial(_has_colours, points=points[kept], colours=values[kept], bits=bits)
            yield Case(f"{name}_{bits}{ending}", file.getvalue(), is_right)


def _has_colours(path: Path, points: FloatArray, colours: IntArray, bits: int) -> bool:
    """Whether these points (N, 3) are read with these colours (N, 3), of this many bits."""
    surface = read_surface(path)
    assert isinstance(surface, PointCloud)
    found = surface.attributes["colours"]
    is_there = surface.points.shape == points.shape and np.allclose(surface.points, points)
    return is_there and found.dtype.itemsize * 8 == bits and np.array_equal(found, colours)
