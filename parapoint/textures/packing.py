"""Several charts packed into the unit square at one scale, by xatlas."""

from __future__ import annotations

import numpy as np
import xatlas

from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray
from parapoint.textures.placing import BORDER, Placing

RESOLUTIONS = (512, 724, 1024)
"""Texels a side of the grids on which xatlas moves the charts about; the densest result counts.
Which one that is is chance: the packer draws places at random."""
PASSES = 2
"""The space between charts is a share of the square, whose side is known after a first pass."""


def packed(charted: Charted, border: float = BORDER) -> Charted:
    """The mesh with its map in the unit square, no chart mirrored and all at one scale.

    One chart is turned to its smallest square. Several are packed by xatlas's packer (J. Young),
    which moves their pictures on a grid; from it we take where each lies and how it is turned.

    Args:
        charted: the mesh and its map.
        border: width that stays free around the map and between charts, in sides of the square.
    """
    held = charted.map
    rows = np.unique(held.corners)
    layouts = [held.uv]
    if int(held.charts().max(initial=0)) > 0:
        layouts = [_packed(held, border, resolution) for resolution in RESOLUTIONS]
    placings = [Placing.smallest(uv[rows], border) for uv in layouts]
    best = max(range(len(layouts)), key=lambda k: placings[k].scale)
    placed = Parameterization(placings[best](layouts[best]), held.corners)
    return Charted(charted.mesh, placed)


def _packed(held: Parameterization, border: float, resolution: int) -> FloatArray:
    """(T, 2) the map with its charts beside one another, in its own scale."""
    faces, label = held.corners, held.charts()
    chart_of = np.zeros(len(held.uv), dtype=np.int64)
    chart_of[faces] = label[:, None]
    apart, side = _apart(held.uv, chart_of, np.unique(faces))
    padding = 0
    for _ in range(PASSES):
        atlas = xatlas.Atlas()
        atlas.add_uv_mesh((apart / side).astype(np.float32), faces.astype(np.uint32))
        options = xatlas.PackOptions()
        options.resolution = resolution
        options.padding = padding
        options.rotate_charts = False  # by xatlas's way of swapping x and y, which mirrors them
        atlas.generate(xatlas.ChartOptions(), options)
        padding = int(np.ceil(border * max(atlas.width, atlas.height)))
    _, indices, found = atlas[0]
    grid = np.zeros_like(held.uv)
    grid[faces] = (found * [atlas.width, atlas.height])[indices.reshape(faces.shape)]
    return _moved(held.uv, grid, chart_of, faces)


def _apart(uv: FloatArray, chart_of: IntArray, rows: IntArray) -> tuple[FloatArray, float]:
    """(T, 2) the charts in shelves, and the side of a square as large as their boxes together.

    xatlas takes charts that touch for one, and its grid's cells in the unit of the map that it is
    given: a map whose charts lie far apart would get a grid too coarse for them.

    Args:
        uv: (T, 2) a map.
        chart_of: (T,) the chart of each of its points.
        rows: points that are in a face.
    """
    low = np.full((int(chart_of.max()) + 1, 2), np.inf)
    high = -low
    np.minimum.at(low, chart_of[rows], uv[rows])
    np.maximum.at(high, chart_of[rows], uv[rows])
    sizes = high - low
    side = float(np.sqrt(sizes.prod(axis=1).sum())) or 1.0
    return uv + (shelves(sizes) - low)[chart_of], side


def _moved(uv: FloatArray, grid: FloatArray, chart_of: IntArray, faces: IntArray) -> FloatArray:
    """Each chart (T, 2) turned and moved, without a change of scale, to where it lies on the grid.

    xatlas stretches each chart to whole texels; the scale of all is the least of theirs.
    """
    rows = np.unique(faces)
    chart = chart_of[rows]
    count = np.bincount(chart)
    z, w = (of[rows] @ [1, 1j] for of in (uv, grid))
    z_mean, w_mean = (
        (np.bincount(chart, of.real) + 1j * np.bincount(chart, of.imag)) / np.maximum(count, 1)
        for of in (z, w)
    )
    z, w = z - z_mean[chart], w - w_mean[chart]
    product = np.conj(z) * w
    turn = np.bincount(chart, product.real) + 1j * np.bincount(chart, product.imag)
    power = np.bincount(chart, np.abs(z) ** 2)
    known = (power > 0) & (np.abs(turn) > 0)
    scale = float((np.abs(turn[known]) / power[known]).min())
    turn = np.where(known, turn / np.where(known, np.abs(turn), 1), 1)
    moved = turn[chart] * z + w_mean[chart] / scale
    out = uv.copy()
    out[rows] = np.stack([moved.real, moved.imag], axis=1)
    return out
