"""Distortion of a map, face by face and as metrics: conformal, authalic, isometric.

The map of a face from its own plane to UV is affine. Its Jacobian J has the singular values
sigma1 >= sigma2 >= 0. The surface and the map are scaled so that the 3D areas sum to 1 and so do
the absolute UV areas; no metric here depends on the scale of either.

A face that is degenerate in 3D has no distortion and is left out. A face that is degenerate in UV
alone has infinite distortion: it makes maxima `inf`, percentiles rank it above all others, and
means leave it out (`degenerate_uv_count` says how many faces these are). Where there is no face to
measure, a metric takes its worst value: `inf`, or 0 for the smallest singular value.

Other papers scale some of these differently. Shay et al. print half of `symmetric_dirichlet`, and
OptCuts a quarter of it, so that the ideal is 1; Rabinovich et al. print what we print.
`angle_discrepancy_total` is 3 times `angle_difference_area_weighted`. The L2 stretch of Sander et
al. is normalized as it is here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from parapoint.errors import InputError
from parapoint.surfaces.areas import cross
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, IntArray, Mesh

SHORTEST_HEIGHT = 1e-12
"""A triangle is degenerate if its height is at most this many times its longest side, ..."""
ROUNDING = 4 * np.finfo(np.float64).eps
"""... or at most this many times the largest coordinate: such an area is rounding error."""
LARGEST = 1e151
"""Largest coordinate, in the unit of the surface or of the map: areas beyond it overflow."""
CLIPPED_RATIO = 10.0
"""Largest area ratio that PartUV counts; larger ones count as this one."""


def power_above(values: FloatArray) -> float:
    """The power of two just above the largest absolute value; 1 if all values are 0.

    To divide by it is exact, and keeps squares and products from overflow and underflow.
    """
    return float(2.0 ** np.frexp(np.abs(values).max(initial=0.0))[1]) if values.any() else 1.0


@dataclass(frozen=True, eq=False)
class Triangles:
    """Every face of a mesh and its image, before anything is normalized; arrays have a row a face.

    Attributes:
        area: (F,) 3D areas.
        uv_area: (F,) signed UV areas, positive where the corners turn counter-clockwise.
        angle: (F, 3) 3D angle at each corner, radians.
        uv_angle: (F, 3) UV angle at each corner, radians.
        sigma1: (F,) larger singular value of J; 0 where the face is degenerate in 3D.
        sigma2: (F,) smaller singular value of J; 0 where degenerate in 3D or in UV.
        degenerate_3d: (F,) whether the face has no 3D area.
        degenerate_uv: (F,) whether it has a 3D area, but no UV area.
    """

    area: FloatArray
    uv_area: FloatArray
    angle: FloatArray
    uv_angle: FloatArray
    sigma1: FloatArray
    sigma2: FloatArray
    degenerate_3d: BoolArray
    degenerate_uv: BoolArray

    @property
    def sign(self) -> IntArray:
        """(F,) 1 for a counter-clockwise image, -1 for a clockwise one, 0 for no UV area."""
        return np.sign(self.uv_area).astype(np.int64)


def triangles(mesh: Mesh, parameterization: Parameterization) -> Triangles:
    """Measure the faces of `mesh` and their images under `parameterization`.

    Raises:
        InputError: coordinates are so large that areas overflow.
    """
    scale = power_above(mesh.vertices[mesh.faces])
    uv_scale = power_above(parameterization.uv[parameterization.corners])
    for what, size in (("vertices", scale), ("uv", uv_scale)):
        if size > LARGEST:
            raise InputError(
                f"coordinates of {what} above {LARGEST:g} make areas overflow: scale them down"
            )
    # sides[k] and uv_sides[k], (F, 3) and (F, 2), are the sides opposite to corner k.
    points = [mesh.vertices[mesh.faces[:, k]] / scale for k in range(3)]
    images = [parameterization.uv[parameterization.corners[:, k]] / uv_scale for k in range(3)]
    sides = [points[(k + 2) % 3] - points[(k + 1) % 3] for k in range(3)]
    uv_sides = [images[(k + 2) % 3] - images[(k + 1) % 3] for k in range(3)]

    double_area = lengths(np.cross(sides[2], -sides[1]))
    double_uv_area = cross(uv_sides[2], -uv_sides[1])
    no_area = _is_degenerate(double_area, sides)
    no_uv_area = _is_degenerate(np.abs(double_uv_area), uv_sides)
    double_area = np.where(no_area, 0.0, double_area)
    double_uv_area = np.where(no_uv_area, 0.0, double_uv_area)

    sigma1, sigma2 = _singular_values(sides, uv_sides, double_area, double_uv_area)
    return Triangles(
        area=double_area / 2 * scale**2,
        uv_area=double_uv_area / 2 * uv_scale**2,
        angle=_angles(sides, double_area),
        uv_angle=_angles(uv_sides, np.abs(double_uv_area)),
        sigma1=sigma1 * (uv_scale / scale),
        sigma2=sigma2 * (uv_scale / scale),
        degenerate_3d=no_area,
        degenerate_uv=no_uv_area & ~no_area,
    )


def lengths(vectors: FloatArray) -> FloatArray:
    """(N,) the length of each of (N, k) vectors."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)), dtype=np.float64)


def _is_degenerate(double_area: FloatArray, sides: list[FloatArray]) -> BoolArray:
    """(F,) whether a triangle has no area. The coordinates lie within [-1, 1]."""
    longest = np.maximum.reduce([lengths(side) for side in sides])
    height = np.maximum(SHORTEST_HEIGHT * longest, ROUNDING)
    return np.asarray(double_area <= longest * height)


def _angles(sides: list[FloatArray], double_area: FloatArray) -> FloatArray:
    cosines = [np.einsum("ij,ij->i", -sides[(k + 1) % 3], sides[(k + 2) % 3]) for k in range(3)]
    return np.stack([np.arctan2(double_area, cosine) for cosine in cosines], axis=1)


def _singular_values(
    sides: list[FloatArray],
    uv_sides: list[FloatArray],
    double_area: FloatArray,
    double_uv_area: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Singular values (F,), (F,) of the maps that send the sides in 3D to those in UV."""
    a, b, uv_a, uv_b = sides[2], -sides[1], uv_sides[2], -uv_sides[1]
    known = double_area > 0
    length = np.where(known, lengths(a), 1.0)
    height = np.where(known, double_area, 1.0) / length
    along = np.einsum("ij,ij->i", a, b) / length
    # In the plane of the face a is (length, 0) and b is (along, height). J maps a to uv_a and b to
    # uv_b, which gives its two columns.
    column0 = uv_a / length[:, None]
    column1 = (uv_b - column0 * along[:, None]) / height[:, None]
    rotation = np.hypot(column0[:, 0] + column1[:, 1], column0[:, 1] - column1[:, 0])
    reflection = np.hypot(column0[:, 0] - column1[:, 1], column0[:, 1] + column1[:, 0])
    sigma1 = np.where(known, (rotation + reflection) / 2, 0.0)
    # abs(rotation - reflection) / 2 loses all digits where sigma1 >> sigma2; sigma1 * sigma2, the
    # ratio of the areas, keeps them.
    denominator = np.where(known & (sigma1 > 0), sigma1 * double_area, 1.0)
    sigma2 = np.where(known, np.abs(double_uv_area), 0.0) / denominator
    return sigma1, np.minimum(sigma1, sigma2)


@dataclass(frozen=True, eq=False)
class FaceDistortion:
    """The normalized distortion of N chosen faces, for heatmaps, histograms and metrics.

    Attributes:
        faces: (N,) rows of the mesh's faces; none is degenerate in 3D.
        area: (N,) 3D areas, sum 1.
        uv_area: (N,) absolute UV areas, sum 1; all 0 if no chosen face has a UV area.
        sigma1: (N,) larger singular value of the normalized J.
        sigma2: (N,) smaller singular value.
        angle_difference: (N, 3) abs(3D angle - UV angle) at each corner, radians.
        finite: (N,) False where the face is degenerate in UV, which makes its distortion infinite.
    """

    faces: IntArray
    area: FloatArray
    uv_area: FloatArray
    sigma1: FloatArray
    sigma2: FloatArray
    angle_difference: FloatArray
    finite: BoolArray

    @cached_property
    def quasi_conformal(self) -> FloatArray:
        """(N,) sigma1 / sigma2, at least 1; inf where degenerate in UV."""
        return self._or_inf(self.sigma1[self.finite] / self.sigma2[self.finite])

    @cached_property
    def area_ratio(self) -> FloatArray:
        """(N,) UV area / 3D area; 0 where degenerate in UV."""
        return self.uv_area / self.area

    @cached_property
    def area_log_ratio(self) -> FloatArray:
        """(N,) abs(log(UV area / 3D area)); inf where degenerate in UV."""
        return self._or_inf(np.abs(np.log(self.area_ratio[self.finite])))

    @cached_property
    def symmetric_dirichlet(self) -> FloatArray:
        """(N,) sigma1^2 + sigma2^2 + sigma1^-2 + sigma2^-2, at least 4; inf where degenerate."""
        squares = np.stack([self.sigma1[self.finite], self.sigma2[self.finite]]) ** 2
        return self._or_inf((squares + 1 / squares).sum(axis=0))

    @cached_property
    def isometric(self) -> FloatArray:
        """(N,) max(sigma1, 1 / sigma2), at least 1; inf where degenerate in UV."""
        return self._or_inf(np.maximum(self.sigma1[self.finite], 1 / self.sigma2[self.finite]))

    @cached_property
    def stretch(self) -> FloatArray:
        """(N,) sqrt((sigma1^-2 + sigma2^-2) / 2), Sander et al. 2001; inf where degenerate."""
        squares = np.stack([self.sigma1[self.finite], self.sigma2[self.finite]]) ** 2
        return self._or_inf(np.sqrt((1 / squares).sum(axis=0) / 2))

    def _or_inf(self, values: FloatArray) -> FloatArray:
        by_face = np.full(len(self.faces), np.inf)
        by_face[self.finite] = values
        return by_face


def face_distortion(faces: Triangles, chosen: BoolArray | None = None) -> FaceDistortion:
    """The distortion of the `chosen` (F,) faces, by default of all, normalized over these alone."""
    keep = ~faces.degenerate_3d if chosen is None else chosen & ~faces.degenerate_3d
    area, uv_area = faces.area[keep], np.abs(faces.uv_area[keep])
    total, uv_total = float(area.sum()), float(uv_area.sum())
    # Without any UV area there is no scale, and every face is degenerate; 1 keeps arrays finite.
    stretch = np.sqrt(total / uv_total) if uv_total > 0 else 1.0
    return FaceDistortion(
        faces=np.flatnonzero(keep).astype(np.int64),
        area=area / total if len(area) else area,
        uv_area=uv_area / uv_total if uv_total > 0 else uv_area,
        sigma1=faces.sigma1[keep] * stretch,
        sigma2=faces.sigma2[keep] * stretch,
        angle_difference=np.abs(faces.angle[keep] - faces.uv_angle[keep]),
        finite=~faces.degenerate_uv[keep],
    )


def mean(values: FloatArray, weights: FloatArray | None = None) -> float:
    """The mean of the finite values, weighted if weights are given; inf if no value is finite."""
    finite = np.isfinite(values)
    if not finite.any():
        return float("inf")
    return float(np.average(values[finite], weights=None if weights is None else weights[finite]))


def percentile(values: FloatArray, percent: float, weights: FloatArray | None = None) -> float:
    """The smallest value that `percent` of the weight does not exceed; inf without values."""
    if len(values) == 0:
        return float("inf")
    order = np.argsort(values)
    reached = np.cumsum(np.ones(len(values)) if weights is None else weights[order])
    # The sum is rounded; a little slack lets equal weights split where they should.
    target = percent / 100 * reached[-1] * (1 - 1e-12)
    return float(values[order[np.searchsorted(reached, target)]])


def maximum(values: FloatArray) -> float:
    """The largest value; inf if there are no values."""
    return float(values.max()) if len(values) else float("inf")


def angle_difference_mean(distortion: FaceDistortion) -> float:
    """Unweighted mean over the corners: the conformality of ParaPoint's supplement and of FAM."""
    return mean(distortion.angle_difference[distortion.finite].reshape(-1))


def angle_difference_area_weighted(distortion: FaceDistortion) -> float:
    """The same, each corner weighted by the area of its face."""
    return mean(
        distortion.angle_difference[distortion.finite].mean(axis=1),
        distortion.area[distortion.finite],
    )


def angle_difference_p95(distortion: FaceDistortion) -> float:
    """Unweighted 95th percentile over the corners, those of faces degenerate in UV left out."""
    return percentile(distortion.angle_difference[distortion.finite].reshape(-1), 95)


def angle_difference_max(distortion: FaceDistortion) -> float:
    """Largest angle difference, that of faces degenerate in UV left out."""
    return maximum(distortion.angle_difference[distortion.finite].reshape(-1))


def angle_discrepancy_total(distortion: FaceDistortion) -> float:
    """Sum over the three corners of a face, averaged over the faces by area (Shay et al.)."""
    return 3 * angle_difference_area_weighted(distortion)


def angle_distortion_max(distortion: FaceDistortion) -> float:
    """Largest sigma1/sigma2 + sigma2/sigma1 - 2 (Shay et al.)."""
    ratio = quasi_conformal_max(distortion)
    return ratio + 1 / ratio - 2


def quasi_conformal_mean(distortion: FaceDistortion) -> float:
    """Area-weighted mean of sigma1/sigma2 (Sander et al. 2001; BFF)."""
    return mean(distortion.quasi_conformal, distortion.area)


def quasi_conformal_p95(distortion: FaceDistortion) -> float:
    """Area-weighted 95th percentile of sigma1/sigma2."""
    return percentile(distortion.quasi_conformal, 95, distortion.area)


def quasi_conformal_max(distortion: FaceDistortion) -> float:
    """Largest sigma1/sigma2."""
    return maximum(distortion.quasi_conformal)


def area_discrepancy_total(distortion: FaceDistortion) -> float:
    """Sum of abs(UV area - 3D area), from 0 to 2 (Shay et al.); inf without any UV area."""
    if not distortion.finite.any():
        return float("inf")
    return float(np.abs(distortion.uv_area - distortion.area).sum())


def area_distortion_max(distortion: FaceDistortion) -> float:
    """Largest a/A + A/a - 2, with UV area a and 3D area A (Shay et al.)."""
    if not len(distortion.faces) or not distortion.finite.all():
        return float("inf")
    return float((distortion.area_ratio + 1 / distortion.area_ratio).max() - 2)


def area_log_ratio_mean(distortion: FaceDistortion) -> float:
    """Area-weighted mean of abs(log(a/A)), with UV area a and 3D area A."""
    return mean(distortion.area_log_ratio, distortion.area)


def area_ratio_clipped_mean(distortion: FaceDistortion) -> float:
    """Unweighted mean over the faces of max(a/A, A/a), clipped at CLIPPED_RATIO (PartUV)."""
    if not distortion.finite.any():
        return float("inf")
    largest_log = np.log(CLIPPED_RATIO)
    return float(np.exp(np.minimum(distortion.area_log_ratio, largest_log)).mean())


def symmetric_dirichlet(distortion: FaceDistortion) -> float:
    """Area-weighted mean of the symmetric Dirichlet energy (SLIM, OptCuts); the ideal is 4."""
    return mean(distortion.symmetric_dirichlet, distortion.area)


def stretch_l2(distortion: FaceDistortion) -> float:
    """Root of the area-weighted mean of the squared stretch (Sander et al. 2001)."""
    return float(np.sqrt(mean(distortion.stretch**2, distortion.area)))


def stretch_linf(distortion: FaceDistortion) -> float:
    """Largest 1/sigma2 (Sander et al. 2001)."""
    smallest = singular_value_min(distortion)
    return 1 / smallest if smallest > 0 else float("inf")


def isometric_distortion_mean(distortion: FaceDistortion) -> float:
    """Area-weighted mean of max(sigma1, 1/sigma2)."""
    return mean(distortion.isometric, distortion.area)


def isometric_distortion_max(distortion: FaceDistortion) -> float:
    """Largest max(sigma1, 1/sigma2)."""
    return maximum(distortion.isometric)


def singular_value_min(distortion: FaceDistortion) -> float:
    """Smallest sigma2 (Shay et al.)."""
    return float(distortion.sigma2.min()) if distortion.finite.any() else 0.0


def singular_value_max(distortion: FaceDistortion) -> float:
    """Largest sigma1 (Shay et al.); inf without any UV area."""
    return float(distortion.sigma1.max()) if distortion.finite.any() else float("inf")
