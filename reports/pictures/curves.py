"""What figures draw of a map as curves: its quality along the way, and how much it stretches.

Both need the map measured face by face, as its pictures do: so they are found with these, and kept
in a file beside them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.metrics.distortion import (
    angle_difference_mean,
    area_discrepancy_total,
    face_distortion,
    triangles,
)
from benchmarks.rendering.maps import Map
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray
from reports.contents import Contents
from reports.pictures.names import CURVES, map_file

BINS = np.linspace(-5, 5, 81)
"""Ends of the bins of log2 of a singular value; the outer two hold all beyond."""


class Curves(NamedTuple):
    """The curves of a map.

    Attributes:
        way: (n, 4) of each map that was kept: seconds, angle and area distortion over all faces,
            and the share of flipped faces among those that span no seam.
        shares: (2, 80) area of the faces by the larger and by the smaller singular value, in BINS;
            none, (0, 80), where no face has any.
    """

    way: FloatArray
    shares: FloatArray


def curves(found: Map) -> Curves:
    """Measure a map and those on its way."""
    return Curves(_way(found), _shares(found))


def _way(found: Map) -> FloatArray:
    rows: list[tuple[float, float, float, float]] = []
    result = found.parameterization
    for at in result.trace:
        if at.uv is not None and len(at.uv) == len(result.uv):
            one = Map(found.mesh, Parameterization(at.uv, result.corners))
            try:
                of_all = face_distortion(triangles(one.mesh, one.parameterization))
                flips = one.flipped[~one.spanning]
            except InputError:  # a state on the way that no number can measure
                continue
            angle, area = angle_difference_mean(of_all), area_discrepancy_total(of_all)
            rows.append((at.seconds, angle, area, float(flips.mean()) if len(flips) else np.nan))
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _shares(found: Map) -> FloatArray:
    """Faces that span a learned seam are left out."""
    of_faces = found.distortion
    shares = []
    for sigma in (of_faces.sigma1, of_faces.sigma2):
        known = of_faces.finite & (sigma > 0)
        at = np.clip(np.log2(sigma[known]), BINS[0], BINS[-1])
        shares.append(np.histogram(at, BINS, weights=of_faces.area[known])[0])
    made = np.array(shares, dtype=np.float64)
    return made if made.max() > 0 else made[:0]


def written(made: Curves) -> Mapping[str, object]:
    """The curves as JSON holds them, to the last digit."""
    return {name: values.tolist() for name, values in made._asdict().items()}


def curves_of(contents: Contents, row: ResultRow, pictures: Path) -> Curves | None:
    """Those of a cell: as they lie beside its pictures, else measured; None without a mesh's map.

    A report of many models does not keep them, and what is not such curves is not read.
    """
    try:
        kept = json.loads((pictures / map_file(row, CURVES)).read_bytes())
        way = np.array(kept["way"], dtype=np.float64).reshape(-1, 4)
        return Curves(way, np.array(kept["shares"], dtype=np.float64).reshape(-1, len(BINS) - 1))
    except (OSError, ValueError, TypeError, KeyError):
        mapped = contents.mapped(row)
        return curves(Map(*mapped)) if mapped else None
