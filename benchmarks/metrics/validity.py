"""Validity of a map: flipped, degenerate and overlapping faces.

A chart is turned over as a whole without harm (a mirrored chart has no flip), so a face is flipped
if its orientation differs from the majority of its own chart, by 3D area. Where the mesh's own
faces do not turn alike, which is no fault of a map, those of a chart are first made to.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import igl
import numpy as np

from benchmarks.metrics.distortion import Triangles
from benchmarks.metrics.overlap import Overlaps, overlaps
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, IntArray


@dataclass(frozen=True, eq=False)
class Validity:
    """What the validity metrics read.

    Attributes:
        parameterization: the map.
        triangles: its faces.
        whole: where this is a part of a map, the state of it all, and which faces (F,) these are.
    """

    parameterization: Parameterization
    triangles: Triangles
    whole: tuple[Validity, BoolArray] | None = None

    def of(self, faces: BoolArray) -> Validity:
        """The state of some of the faces (F,); those are flipped that are so in the whole map."""
        parameterization = Parameterization(
            self.parameterization.uv, self.parameterization.corners[faces]
        )
        parts = {name: values[faces] for name, values in vars(self.triangles).items()}
        return Validity(parameterization, Triangles(**parts), (self, faces))

    @cached_property
    def flipped(self) -> BoolArray:
        """(F,) whether a face is folded against the majority of its chart, by 3D area.

        Faces without UV area have no orientation and are not flipped. In a tie the
        counter-clockwise faces are the majority.
        """
        if self.whole is not None:
            validity, faces = self.whole
            return validity.flipped[faces]
        sign, chart = self.triangles.sign * self.turn, self.parameterization.charts()
        balance = np.bincount(chart, sign * self.triangles.area)
        return np.asarray(sign * np.where(balance < 0, -1, 1)[chart] < 0)

    @property
    def turn(self) -> IntArray:
        """(F,) -1 for faces to be turned so that across inner edges of a chart faces turn alike.

        1 for all others, and for all faces of a map that are so already.
        """
        image, corners = self.parameterization, self.parameterization.corners
        forward = (corners < np.roll(corners, -1, axis=1)).reshape(-1)
        alike = np.bincount(image.edge_of_halfedge, forward) == 1
        turn = np.ones(len(corners), dtype=np.int64)
        faces = np.flatnonzero(self.triangles.sign)  # others may name a row twice
        if len(faces) and not alike[image.edge_face_count == 2].all():
            turned, _ = igl.bfs_orient(corners[faces])
            turn[faces[(turned != corners[faces]).any(axis=1)]] = -1
        return turn

    @cached_property
    def overlaps(self) -> Overlaps:
        """Which faces overlap, and by how much."""
        return overlaps(self.parameterization, self.triangles.sign, self.triangles.uv_angle)


def flipped_fraction(validity: Validity) -> float:
    """Fraction of the faces that are flipped within their chart."""
    return float(validity.flipped.mean())


def flipped_fraction_global(validity: Validity) -> float:
    """min(p, 1 - p) for the fraction p of faces with clockwise image (Shay et al.)."""
    clockwise = float((validity.triangles.sign < 0).mean())
    return min(clockwise, 1 - clockwise)


def flipped_area_fraction(validity: Validity) -> float:
    """3D area fraction of the faces that are flipped within their chart."""
    area = validity.triangles.area
    total = float(area.sum())
    return float(area[validity.flipped].sum()) / total if total > 0 else 0.0


def flipped_uv_area_fraction(validity: Validity) -> float:
    """UV area of the flipped faces over the absolute UV area of all; inf without any UV area."""
    uv_area = np.abs(validity.triangles.uv_area)
    total = float(uv_area.sum())
    return float(uv_area[validity.flipped].sum()) / total if total > 0 else float("inf")


def degenerate_uv_count(validity: Validity) -> float:
    """Number of faces with 3D area but without UV area."""
    return float(validity.triangles.degenerate_uv.sum())


def degenerate_3d_count(validity: Validity) -> float:
    """Number of faces without 3D area."""
    return float(validity.triangles.degenerate_3d.sum())


def overlap_area(validity: Validity) -> float:
    """Sum over ordered pairs of the common area, in 3D area fraction (Shay et al.).

    The common area is divided by the magnification of the first face of the pair: a surface
    that is covered twice throughout reads 1.
    """
    triangles = validity.triangles
    uv_area, total = np.abs(triangles.uv_area), float(triangles.area.sum())
    covered = uv_area > 0
    share = validity.overlaps.area[covered] / uv_area[covered]
    return float(share @ triangles.area[covered]) / total if total > 0 else 0.0


def overlap_pair_fraction(validity: Validity) -> float:
    """Overlapping pairs that share no row of uv, over all pairs of faces (FAM)."""
    count = len(validity.triangles.area)
    return validity.overlaps.distant_pair_count / (count * (count - 1) / 2) if count > 1 else 0.0


def overlapped_fraction(validity: Validity) -> float:
    """3D area fraction of the faces that overlap another."""
    area = validity.triangles.area
    total = float(area.sum())
    return float(area[validity.overlaps.overlapped].sum()) / total if total > 0 else 0.0


def bijective(validity: Validity) -> float:
    """1 if no face is flipped, degenerate in UV (only) or overlaps another; else 0."""
    sound = not (
        validity.flipped.any()
        or validity.triangles.degenerate_uv.any()
        or validity.overlaps.overlapped.any()
    )
    return float(sound)
