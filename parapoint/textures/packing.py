"""Several charts packed into the unit square at one scale, by xatlas or on shelves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xatlas
from scipy.sparse import csr_array

from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Charted, Parameterization
from parapoint.surfaces.preparation import shelves
from parapoint.surfaces.surface import FloatArray, IntArray, edge_components
from parapoint.textures.placing import BORDER, Placing

RESOLUTIONS = (512, 724, 1024)
"""Texels a side of the grids on which xatlas moves the charts about. Which of them leads to the
densest result is chance: the packer draws places at random."""
PASSES = 2
"""The space between charts is a share of the square, whose side is known after a first pass."""
FLAT = 1e-5
"""Area, in texels of the grid, up to which a face does not count for the shape of its chart: xatlas
passes over faces below 1e-7, and leaves corners that belong to no other face where they were."""
LEAST = 2.0
"""Side, in texels of the grid, of the smallest box that stands for a chart. xatlas draws charts
below a texel as points, and puts these on top of others."""


def packed(charted: Charted, border: float = BORDER) -> Charted:
    """The mesh with its map in the unit square, no chart mirrored and all at one scale.

    One chart is turned to its smallest square. Several are packed by xatlas's packer (J. Young),
    which moves their pictures on a grid; from it we take where each lies and how it is turned. They
    are set on shelves, too, which fill the square better where charts are many and much alike. The
    densest result counts.

    Args:
        charted: the mesh and its map.
        border: width that stays free around the map and between charts, in sides of the square.
    """
    held = _without_pinches(charted.map)
    rows = np.unique(held.corners)
    layouts = [held.uv]
    if int(held.charts().max(initial=0)) > 0:
        layouts = [_packed(held, border, resolution) for resolution in RESOLUTIONS]
        layouts.append(_shelved(held, border))
    placings = [Placing.smallest(uv[rows], border) for uv in layouts]
    filled = [
        placing.scale**2 * float(np.abs(signed_areas(uv, held.corners)).sum())
        for placing, uv in zip(placings, layouts, strict=True)
    ]
    best = int(np.argmax(filled))
    placed = Parameterization(placings[best](layouts[best]), held.corners)
    return Charted(charted.mesh, placed)


class _Shapes(NamedTuple):
    """What the packer moves.

    Attributes:
        uv: (T, 2) points, in texels of the grid.
        chart: (T,) the chart of each.
        faces: (F, 3) triangles.
    """

    uv: FloatArray
    chart: IntArray
    faces: IntArray


def _without_pinches(held: Parameterization) -> Parameterization:
    """The map with a row more for each place at which a chart only touches another."""
    label, corners = held.charts()[:, None], held.corners.copy()
    owner = np.full(len(held.uv), -1)
    owner[corners] = label
    is_lent = owner[corners] != label
    pairs = np.stack([corners, np.broadcast_to(label, corners.shape)], axis=2)[is_lent]
    lent, row = np.unique(pairs, axis=0, return_inverse=True)
    corners[is_lent] = len(held.uv) + row.ravel()
    return Parameterization(np.concatenate([held.uv, held.uv[lent[:, 0]]]), corners)


def _packed(held: Parameterization, border: float, resolution: int) -> FloatArray:
    """(T, 2) the map with its charts beside one another, in texels of a grid."""
    apart = _apart(held, resolution)
    shapes = _shapes(apart, held.charts())
    padding = 0
    for _ in range(PASSES):
        atlas = xatlas.Atlas()
        atlas.add_uv_mesh(shapes.uv.astype(np.float32), shapes.faces.astype(np.uint32))
        options = xatlas.PackOptions()
        options.resolution = resolution
        options.padding = padding
        options.rotate_charts = False  # by xatlas's way of swapping x and y, which mirrors them
        atlas.generate(xatlas.ChartOptions(), options)
        padding = int(np.ceil(border * max(atlas.width, atlas.height)))
    _, indices, found = atlas[0]
    grid = np.zeros_like(shapes.uv)
    grid[shapes.faces] = (found * [atlas.width, atlas.height])[indices.reshape(shapes.faces.shape)]
    return _moved(shapes, grid)[: len(held.uv)]


def _shelved(held: Parameterization, border: float) -> FloatArray:
    """(T, 2) the map with its charts on shelves, each turned to lie in its smallest square."""
    chart = _chart_of_rows(held)
    uv = held.uv.copy()
    rows = np.argsort(chart, kind="stable")
    for some in np.split(rows, np.flatnonzero(np.diff(chart[rows])) + 1):
        turned = uv[some] @ Placing.smallest(uv[some]).turn.T
        width, height = np.ptp(turned, axis=0)
        uv[some] = turned if width >= height else turned @ [[0, 1], [-1, 0]]
    low, high = _boxes(_Shapes(uv, chart, held.corners))
    sizes = high - low
    gap, square = border, float(np.sqrt(sizes.prod(axis=1).sum())) or 1.0
    for _ in range(PASSES):
        corners = shelves(sizes, gap)
        gap = border * float((corners + sizes).max()) / square
    return uv + (corners - low)[chart]


def _chart_of_rows(held: Parameterization) -> IntArray:
    """(T,) the chart of each row of uv; 0 for those of no face."""
    chart = np.zeros(len(held.uv), dtype=np.int64)
    chart[held.corners] = held.charts()[:, None]
    return chart


def _apart(held: Parameterization, resolution: int) -> _Shapes:
    """The charts on shelves, sized so that their boxes together fill the grid once.

    xatlas takes charts that touch for one, and makes its grid as coarse as the whole map is wide.
    """
    chart = _chart_of_rows(held)
    given = _Shapes(held.uv, chart, held.corners)
    low, high = _boxes(given)
    sizes = high - low
    unit = resolution / (float(np.sqrt(sizes.prod(axis=1).sum())) or 1.0)
    return given._replace(uv=(held.uv + (shelves(sizes) - low)[chart]) * unit)


def _shapes(apart: _Shapes, label: IntArray) -> _Shapes:
    """The charts without their flat faces (FLAT).

    A box stands for each chart that falls apart so, and for each that is smaller than LEAST.

    Args:
        apart: all faces of the charts.
        label: (F,) the chart of each face.
    """
    uv, chart, faces = apart
    is_thick = np.abs(signed_areas(uv, faces)) > FLAT
    pieces = np.stack([label[is_thick], edge_components(faces[is_thick])], axis=1)
    is_sound = np.bincount(np.unique(pieces, axis=0)[:, 0], minlength=int(label.max()) + 1) == 1
    low, high = _boxes(apart)
    is_sound &= (high - low).max(axis=1) >= LEAST
    boxed = np.flatnonzero(~is_sound)
    sides = np.maximum(high - low, LEAST)[boxed, None] * [[0, 0], [1, 0], [1, 1], [0, 1]]
    first = len(uv) + 4 * np.arange(len(boxed))[:, None, None]
    boxes = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return _Shapes(
        np.concatenate([uv, (low[boxed, None] + sides).reshape(-1, 2)]),
        np.concatenate([chart, np.repeat(boxed, 4)]),
        np.concatenate([faces[is_thick & is_sound[label]], boxes]),
    )


def _boxes(shapes: _Shapes) -> tuple[FloatArray, FloatArray]:
    """(C, 2) lower left and (C, 2) upper right corner of the box around each chart."""
    rows = np.unique(shapes.faces)
    low = np.full((int(shapes.chart.max()) + 1, 2), np.inf)
    high = -low
    np.minimum.at(low, shapes.chart[rows], shapes.uv[rows])
    np.maximum.at(high, shapes.chart[rows], shapes.uv[rows])
    return low, high


def _moved(shapes: _Shapes, grid: FloatArray) -> FloatArray:
    """Each chart (T, 2) turned and moved, without a change of scale, to where it lies on the grid.

    xatlas stretches each chart to whole texels; the scale of all is the least of theirs.

    Args:
        shapes: what was packed.
        grid: (T, 2) where xatlas has drawn each point that belongs to a face.
    """
    rows = np.unique(shapes.faces)
    chart = shapes.chart
    weight = 1 / np.bincount(chart[rows], minlength=int(chart.max()) + 1)
    mean = csr_array((weight[chart[rows]], (chart[rows], rows)), shape=(len(weight), len(chart)))
    z, w = shapes.uv @ [1, 1j], grid @ [1, 1j]
    z, goal = z - (mean @ z)[chart], mean @ w
    w = w - goal[chart]
    turn, spread = mean @ (np.conj(z) * w), mean @ np.abs(z) ** 2
    scale = float((np.abs(turn) / spread).min())
    moved = scale * (turn / np.abs(turn))[chart] * z + goal[chart]
    return np.stack([moved.real, moved.imag], axis=1)
