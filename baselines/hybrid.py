"""One-to-one SLIM along other seams than those of `unwrap`: the automatic cut's, an artist's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, cast

from parapoint.errors import InputError
from parapoint.method import UnsupportedError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface
from parapoint.unwrapping.descent import Run, sound
from parapoint.unwrapping.domains import check_iterations, domain
from parapoint.unwrapping.given import unwrapped_along
from parapoint.unwrapping.growth import grow


@dataclass(frozen=True)
class AutomaticSLIM:
    """SLIM along the automatic cut, grown and kept one to one.

    Held against that one it tells what the learned seam is worth, and what a longer seam is.

    Attributes:
        iterations: steps of SLIM, at least 1; the longer seam takes more.
        price: as of `parapoint.unwrapping.unwrap.Unwrap`; None for the automatic cut as it is.
    """

    iterations: int = 20
    price: float | None = 0.1

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        _check(self.iterations, self.price)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no disk, with or without holes; no shapely.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding has flips.
        """
        disk = domain(surface)
        run = Run(sound(Mesh(disk.vertices, disk.faces)))
        run.begin(None)
        run.improve(self.iterations)
        if self.price is not None:
            grow(run, self.price)
        return Parameterization(run.uv, run.mesh.faces, report=run.report())


@dataclass(frozen=True)
class ArtistSLIM:
    """SLIM over each chart of the map that a model came with, its seams taken as they are.

    SLIM starts from a bijective map and is kept one to one, as along learned seams. Charts that
    are no disks, with or without holes, are cut to disks automatically (the report counts them);
    all are packed without a change of scale.

    Attributes:
        iterations: steps of SLIM, at least 1.
    """

    iterations: int = 20

    requires: ClassVar[frozenset[str]] = frozenset({"manifold", "oriented", "seams"})
    packages: ClassVar[tuple[str, ...]] = ("libigl", "shapely")

    def __post_init__(self) -> None:
        check_iterations(self.iterations)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map in the scale of the surface.

        Raises:
            UnsupportedError: the surface is no mesh that came with a map.
            InputError: a triangle has no area.
            FlatteningError: a chart has no start without flips.
        """
        if not isinstance(surface, Mesh) or surface.seams is None:
            raise UnsupportedError("needs a mesh that came with a UV map")
        result = unwrapped_along(surface, surface.seams, self.iterations)
        parts = cast("list[dict[str, int]]", result.report["parts"])
        report = {
            "charts": int(result.charts().max()) + 1,
            "charts_cut_to_disks": result.report["charts_cut_to_disks"],
            "held_steps": sum(part["held_steps"] for part in parts),
        }
        return Parameterization(result.uv, result.corners, report=report)


def _check(iterations: int, price: float | None) -> None:
    check_iterations(iterations)
    if price is not None and not price >= 0:
        raise InputError(f"price must be at least 0 or None, not {price}")
