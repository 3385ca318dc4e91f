"""uvunwrap: an atlas of many charts."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar, Literal

import numpy as np

from baselines.tools.atlas import atlas
from baselines.tools.optional import optional
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.frame import UNIT, Frame, in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface

uvunwrap = optional("uvunwrap", "pip install uvunwrap")


@dataclass(frozen=True)
class UVUnwrap:
    """Atlas of charts of limited angle and area distortion, packed.

    https://github.com/archonic/uvunwrap (Rust, MIT). Takes any mesh. Several pages are laid side by
    side.

    Attributes:
        max_chart_angle: largest angle in degrees between a face's and its chart's normal.
        max_area_distortion: a chart with a triangle distorted more is split.
        max_chart_area: largest 3D area of a chart; 0 for no limit.
        max_boundary_length: longest boundary of a chart; 0 for no limit.
        page_size: side of a page in texels.
        padding: texels between charts.
        packing: "shape" (dense) or "fast".
    """

    max_chart_angle: float = 70.0
    max_area_distortion: float = 4.0
    max_chart_area: float = 0.0
    max_boundary_length: float = 0.0
    page_size: int = 1024
    padding: int = 2
    packing: Literal["shape", "fast"] = "shape"

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("uvunwrap",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (uvunwrap takes no seed)
        """The atlas, in texels.

        Raises:
            UnsupportedError: the surface is a point cloud, or uvunwrap is not installed.
            FlatteningError: uvunwrap panicked, or returned other faces or NaN.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        unit = UNIT / Frame.of(surface.vertices[surface.referenced]).scale
        options = asdict(self)
        options["max_boundary_length"] *= unit
        options["max_chart_area"] *= unit**2
        given = uvunwrap.Mesh(
            in_unit(surface.vertices, surface.faces), surface.faces.astype(np.uint32)
        )
        try:
            made = uvunwrap.generate([given], **options)
        except BaseException as error:
            if type(error).__name__ == "PanicException":  # Rust's; no subclass of Exception
                raise FlatteningError(f"uvunwrap panicked: {error}") from None
            raise
        mesh = made.meshes[0]
        return atlas(
            surface,
            source=mesh.xref,
            corners=np.reshape(mesh.indices, (-1, 3)),
            uv=np.reshape(mesh.uv, (-1, 2)),
            page_size=(made.width, made.height),
            page=mesh.page,
        )
