"""Microsoft's UVAtlas, through Open3D: an atlas of charts of limited stretch."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import numpy as np

from baselines.tools.atlas import joined_corners
from baselines.tools.optional import optional
from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.frame import in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface


@cache
def open3d() -> Any:
    """The library, imported at the first call: it takes seconds."""
    return optional(
        "open3d",
        "pip install open3d, and the system library libusb-1.0.so.0 (Debian: libusb-1.0-0)",
    )


@dataclass(frozen=True)
class UVAtlas:
    """Atlas of few charts of limited stretch (Iso-charts), packed.

    K. Zhou et al. 2004, "Iso-charts: stretch-driven mesh parameterization using spectral
    analysis", as https://github.com/microsoft/UVAtlas has it and Open3D wraps it. Works in float32
    and on one thread. Charts stay nearly the same from run to run, their places do not.

    Attributes:
        max_stretch: largest stretch of a chart, from 0 (none; many charts) to 1 (any; few charts).
        size: side of the page in texels.
        gutter: texels between charts.
        partitions: parts into which the mesh is split first; more than 1 is faster, with more
            charts.
    """

    max_stretch: float = 1 / 6
    size: int = 512
    gutter: float = 1.0
    partitions: int = 1

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold"})
    packages: ClassVar[tuple[str, ...]] = ("open3d",)
    deterministic: ClassVar[bool] = False  # its random numbers cannot be seeded

    def __post_init__(self) -> None:
        if not 0 <= self.max_stretch <= 1:
            raise InputError(f"max_stretch must lie between 0 and 1, not {self.max_stretch}")

    def preload(self) -> None:
        """Import Open3D."""
        open3d()

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (UVAtlas takes no seed)
        """The atlas, in texels.

        Raises:
            UnsupportedError: the surface is a point cloud, or Open3D is not installed.
            FlatteningError: UVAtlas failed; its message.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        library = open3d()
        made = library.t.geometry.TriangleMesh(
            library.core.Tensor(in_unit(surface.vertices, surface.faces).astype(np.float32)),
            library.core.Tensor(surface.faces.copy()),
        )
        try:
            with library.utility.VerbosityContextManager(library.utility.VerbosityLevel.Error):
                stretch, _, _ = made.compute_uvatlas(
                    size=self.size,
                    gutter=self.gutter,
                    max_stretch=self.max_stretch,
                    parallel_partitions=self.partitions,
                    nthreads=1,
                )
        except RuntimeError as error:
            raise FlatteningError(" ".join(str(error).split())) from None
        uv = made.triangle.texture_uvs.numpy().astype(np.float64) * self.size
        result = joined_corners(surface, uv)
        return Parameterization(result.uv, result.corners, report={"max_stretch": float(stretch)})
