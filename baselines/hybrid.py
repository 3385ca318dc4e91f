"""One-to-one maps along other seams than those of `unwrap`: the automatic cut's, an artist's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from parapoint.method import UnsupportedError
from parapoint.parameters import check_number
from parapoint.planar.descent import Run, sound
from parapoint.planar.domains import domain
from parapoint.planar.growth import PRICE, Need, grown
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface
from parapoint.unwrapping.given import unwrapped_along


@dataclass(frozen=True)
class AutomaticSLIM:
    """An isometric map along the automatic cut, grown and kept one to one.

    Held against `unwrap`, which begins so as well, it tells what the other start is worth.

    Attributes:
        price: as of `parapoint.unwrapping.unwrap.Unwrap`; None for the automatic cut as it is.
    """

    price: float | None = PRICE

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    def __post_init__(self) -> None:
        if self.price is not None:
            check_number("price", self.price)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes; no shapely.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding has flips.
        """
        disk = domain(surface)
        run = Run(sound(Mesh(disk.vertices, disk.faces)))
        run.begin()
        run.improve()
        if self.price is not None:
            run = grown(run, Need(self.price))
            run.improve()
        return Parameterization(run.uv, run.mesh.faces, report=run.report())


@dataclass(frozen=True)
class ArtistSLIM:
    """An isometric map of each chart of the map that a model came with, its seams kept.

    It is kept one to one, as along learned seams. Charts that
    are no disks, with or without holes, are cut to disks automatically (the report counts them);
    all are packed without a change of scale.
    """

    requires: ClassVar[frozenset[str]] = frozenset({"manifold", "oriented", "seams"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "scipy", "shapely")

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no mesh that came with a map.
            InputError: a triangle has no area.
            FlatteningError: a chart has no start without flips.
        """
        if not isinstance(surface, Mesh) or surface.seams is None:
            raise UnsupportedError("needs a mesh that came with a UV map")
        result = unwrapped_along(surface, surface.seams)
        report = {
            "charts": int(result.charts().max()) + 1,
            "charts_cut_to_disks": result.report["charts_cut_to_disks"],
        }
        return Parameterization(result.uv, result.corners, report=report)
