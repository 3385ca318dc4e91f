"""Metrics that compare a map with a reference, such as the one an artist made for the model.

Source: Shay, Solomon, Stein.
"""

from __future__ import annotations

import numpy as np

from benchmarks.metrics import seams
from benchmarks.metrics.distortion import Triangles
from benchmarks.metrics.state import MapState
from parapoint.surfaces.surface import FloatArray


def artist_correlation(state: MapState) -> float:
    """abs(rho - 1), where rho correlates log sigma with that of the reference, weighted by area.

    Both singular values of each face count; faces degenerate in either map are left out. A map
    without any variation of sigma correlates perfectly with another such map, and with no other.
    inf if no face is left.
    """
    ours, theirs = state.triangles, state.reference_state.triangles
    kept = ~(ours.degenerate_3d | ours.degenerate_uv | theirs.degenerate_uv)
    if not kept.any():
        return float("inf")
    weights = np.tile(ours.area[kept] / ours.area[kept].sum() / 2, 2)

    def centred(of: Triangles) -> FloatArray:
        logs = np.log(np.concatenate([of.sigma1[kept], of.sigma2[kept]]))
        return np.asarray(logs - weights @ logs)

    a, b = centred(ours), centred(theirs)
    a_variance, b_variance = float(weights @ a**2), float(weights @ b**2)
    # Deviations of less than 1e-12 are rounding: an isometry.
    constant = (a_variance < 1e-24, b_variance < 1e-24)
    if any(constant):
        return 0.0 if all(constant) else 1.0
    return abs(float(weights @ (a * b)) / float(np.sqrt(a_variance * b_variance)) - 1)


def seam_excess(state: MapState) -> float:
    """Seam length beyond that of the reference; 0 if the seam is not longer."""
    ours = seams.seam_length(state.seams)
    theirs = seams.seam_length(state.reference_state.seams)
    return max(ours - theirs, 0.0) if ours < np.inf else ours
