"""Validity of a map: flipped, degenerate and overlapping faces.

A chart that is mirrored as a whole has no flips. So a face counts as flipped if it is turned
against the majority of its own chart, by 3D area. Where the faces of the mesh itself do not all
turn the same way, which is no fault of the map, those of each chart are first made to.
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
        whole: where these are some faces of a map, the whole of it, and which of its faces (F,)
            they are; None where they are all.
    """

    parameterization: Parameterization
    triangles: Triangles
    whole: tuple[Validity, BoolArray] | None = None

    def of(self, faces: BoolArray) -> Validity:
        """The validity of some faces (F,); they are flipped if they are flipped in the whole."""
        parameterization = Parameterization(
            self.parameterization.uv, self.parameterization.corners[faces]
        )
        parts = {name: values[faces] for name, values in vars(self.triangles).items()}
        return Validity(parameterization, Triangles(**parts), (self, faces))

    @cached_property
    def flipped(self) -> BoolArray:
        """(F,) whether a face is turned against the majority of its chart, by 3D area.

        A face without UV area has no orientation and is not flipped. If the two orientations have
        equal area, the counter-clockwise faces are the majority.
        """
        if self.whole is not None:
            validity, faces = self.whole
            return validity.flipped[faces]
        sign, chart = self.triangles.sign * self.turn, self.parameterization.charts()
        balance = np.bincount(chart, sign * self.triangles.area)
        return np.asarray(sign * np.where(balance < 0, -1, 1)[chart] < 0)

    @property
    def turn(self) -> IntArray:
        """(F,) -1 for each face that has to be turned so that neighbours in a chart turn alike.

        1 for all other faces.
        """
        image, corners = self.parameterization, self.parameterization.corners
        forward = (corners < np.roll(corners, -1, axis=1)).reshape(-1)
        alike = np.bincount(image.edge_of_halfedge, forward) == 1
        turn = np.ones(len(corners), dtype=np.int64)
        faces = np.flatnonzero(self.triangles.sign)  # the others may use a row of uv twice
        if len(faces) and not alike[image.edge_face_count == 2].all():
            turned, _ = igl.bfs_orient(corners[faces])
            turn[faces[(turned != corners[faces]).any(axis=1)]] = -1
        return turn

    @cached_property
    def overlaps(self) -> Overlaps:
        """Which faces overlap, and by how much."""
        return overlaps(self.parameterization, self.triangles.sign, self.triangles.uv_angle)


def flipped_fraction(validity: Validity) -> float:
    """Fraction of the faces, by number, that are flipped within their chart; 0 without any face."""
    flipped = validity.flipped
    return float(flipped.mean()) if len(flipped) else 0.0


def flipped_fraction_global(validity: Validity) -> float:
    """min(p, 1 - p), where p is the fraction of faces with a clockwise image (Shay et al.)."""
    clockwise = float((validity.triangles.sign < 0).mean())
    return min(clockwise, 1 - clockwise)


def flipped_area_fraction(validity: Validity) -> float:
    """Fraction of the 3D area that is flipped within its chart."""
    area = validity.triangles.area
    total = float(area.sum())
    return float(area[validity.flipped].sum()) / total if total > 0 else 0.0


def flipped_uv_area_fraction(validity: Validity) -> float:
    """UV area of the flipped faces over the absolute UV area of all; inf without any UV area."""
    uv_area = np.abs(validity.triangles.uv_area)
    total = float(uv_area.sum())
    return float(uv_area[validity.flipped].sum()) / total if total > 0 else float("inf")


def degenerate_uv_count(validity: Validity) -> float:
    """Number of faces that have a 3D area, but no UV area."""
    return float(validity.triangles.degenerate_uv.sum())


def degenerate_3d_count(validity: Validity) -> float:
    """Number of faces that have no 3D area."""
    return float(validity.triangles.degenerate_3d.sum())


def overlap_area(validity: Validity) -> float:
    """Common area of all ordered pairs of faces, as a fraction of the 3D area (Shay et al.).

    The common UV area of a pair is carried back to the first face of the pair. A map that lies on
    itself everywhere, in two layers, scores 1.
    """
    triangles = validity.triangles
    uv_area, total = np.abs(triangles.uv_area), float(triangles.area.sum())
    covered = uv_area > 0
    share = validity.overlaps.area[covered] / uv_area[covered]
    return float(share @ triangles.area[covered]) / total if total > 0 else 0.0


def overlap_pair_fraction(validity: Validity) -> float:
    """Fraction of all pairs of faces that overlap and share no row of uv (FAM)."""
    count = len(validity.triangles.area)
    return validity.overlaps.distant_pair_count / (count * (count - 1) / 2) if count > 1 else 0.0


def overlapped_fraction(validity: Validity) -> float:
    """Fraction of the 3D area whose faces overlap another face."""
    area = validity.triangles.area
    total = float(area.sum())
    return float(area[validity.overlaps.overlapped].sum()) / total if total > 0 else 0.0


def bijective(validity: Validity) -> float:
    """1 if no face is flipped, degenerate in UV alone or overlaps another; else 0."""
    sound = not (
        validity.flipped.any()
        or validity.triangles.degenerate_uv.any()
        or validity.overlaps.overlapped.any()
    )
    return float(sound)
