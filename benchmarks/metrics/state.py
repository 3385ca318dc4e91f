"""A map, with everything that more than one metric needs."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from benchmarks.metrics import seams, usability, validity
from benchmarks.metrics.distortion import FaceDistortion, Triangles, face_distortion, triangles
from benchmarks.metrics.welding import scored
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, Mesh


@dataclass(frozen=True, eq=False)
class MapState:
    """A map, and what metrics share about it; each part is computed once, when it is first needed.

    Faces that the map leaves out (NaN) are left out here too, and vertices at one place are welded.

    Attributes:
        mesh: the surface.
        parameterization: the map.
        reference: another map of the same faces, or None; it covers all that the map covers.
        coverage: share of the surface, from 0 to 1, that the map covers.
        welded: number of vertices that lie where another one does.

    Raises:
        InputError: a map has another number of faces than the mesh, or the reference leaves out
            faces that the map covers.
    """

    mesh: Mesh
    parameterization: Parameterization
    reference: Parameterization | None = None
    coverage: float = field(init=False, default=1.0)
    welded: int = field(init=False, default=0)

    def __post_init__(self) -> None:
        for name, of in (("map", self.parameterization), ("reference", self.reference)):
            if of is not None and len(of.corners) != len(self.mesh.faces):
                raise InputError(
                    f"the {name} has {len(of.corners)} faces, the mesh {len(self.mesh.faces)}; "
                    "both must have the same faces in the same order"
                )
        if self.reference is not None:
            left_out = int((self.parameterization.covered & ~self.reference.covered).sum())
            if left_out:
                raise InputError(
                    f"the reference leaves out {left_out} of the faces that the map covers; "
                    "it must cover them all"
                )
        found = scored(self.mesh, self.parameterization, self.reference)
        for name, value in found._asdict().items():
            object.__setattr__(self, name, value)

    @cached_property
    def triangles(self) -> Triangles:
        """Every face, before any normalization."""
        return triangles(self.mesh, self.parameterization)

    @cached_property
    def spanning(self) -> BoolArray:
        """(F,) whether a face spans a seam."""
        overlapped = self.validity.overlaps.overlapped
        return seams.spanning_faces(self.mesh, self.parameterization, overlapped)

    @cached_property
    def distortion(self) -> FaceDistortion:
        """Distortion of all faces with 3D area."""
        return face_distortion(self.triangles)

    @cached_property
    def distortion_without_spanning(self) -> FaceDistortion:
        """Distortion of the faces with 3D area that span no seam."""
        if not self.spanning.any():
            return self.distortion
        return face_distortion(self.triangles, ~self.spanning)

    @cached_property
    def validity_without_spanning(self) -> validity.Validity:
        """What the validity metrics need, over the faces that span no seam."""
        return self.validity.of(~self.spanning) if self.spanning.any() else self.validity

    @cached_property
    def validity(self) -> validity.Validity:
        """What the validity metrics need."""
        return validity.Validity(self.parameterization, self.triangles)

    @cached_property
    def worst(self) -> usability.Worst:
        """What the metrics of starved parts need: parts that get too little of the UV area."""
        return usability.Worst(self.mesh, self.distortion)

    @cached_property
    def worst_without_spanning(self) -> usability.Worst:
        """The same over the faces that span no seam."""
        if not self.spanning.any():
            return self.worst
        return usability.Worst(self.mesh, self.distortion_without_spanning)

    @cached_property
    def layout(self) -> usability.Layout:
        """What the metrics of the seam's shape and of the unit square need."""
        return usability.Layout(self.mesh, self.parameterization, self.triangles)

    @cached_property
    def seams(self) -> seams.Seams:
        """What the metrics of seams, charts and packing need."""
        return seams.Seams(self.mesh, self.parameterization, self.triangles, self.validity.overlaps)

    @cached_property
    def reference_state(self) -> MapState:
        """The state of the reference map.

        Raises:
            InputError: there is no reference.
        """
        if self.reference is None:
            raise InputError("this metric needs a reference map")
        return MapState(self.mesh, self.reference)
