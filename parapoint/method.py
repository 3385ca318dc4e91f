"""What a parameterization method is, what it may require, and how a surface is made to fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol, runtime_checkable

from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import Mesh, PointCloud, Surface


@runtime_checkable
class Method(Protocol):
    """A parameterization method: a dataclass whose fields are its hyperparameters.

    It may have a method `preload()`, called once before `parameterize` is timed: there it imports
    or starts what is slow to come, and raises MissingError where that is not installed.

    It may have a class attribute `environment`, a tuple of requirements as pip reads them, such as
    ("bpy>=4.3",): `python -m benchmarks run` makes an environment that has them, once, and runs the
    method there. The module of the method is imported outside of it, too, so such packages are
    imported in `preload` or `parameterize`.

    Attributes:
        requires: what the surface must be, words of `REQUIREMENTS`. Empty: a mesh or a point cloud.
    """

    requires: ClassVar[frozenset[str]]

    def parameterize(
        self, surface: Surface, *, seed: int
    ) -> Parameterization | PointParameterization:
        """The map of `surface`; every random draw comes from `seed`. Must not change `surface`.

        A mesh gives a Parameterization, a point cloud a PointParameterization.
        """
        ...


class UnsupportedError(Exception):
    """A method cannot take a surface; the message says why. The cell is `skipped`."""


class MissingError(UnsupportedError):
    """A method needs a package or program that is not there; the message says how to get it.

    The cell is `skipped`, and the next run tries it again.
    """


def _not_a_mesh(surface: Surface) -> str | None:
    return "needs faces; the surface is a point cloud" if isinstance(surface, PointCloud) else None


def _not_a_disk(surface: Surface) -> str | None:
    if isinstance(surface, PointCloud) or surface.topology == "disk":
        return _not_a_mesh(surface)
    return f"needs a disk; the surface is {surface.topology}"


def _cuda_missing(_: Surface) -> str | None:
    import torch  # here, so that importing parapoint leaves torch out

    return None if torch.cuda.is_available() else "needs a CUDA device; none is available"


REQUIREMENTS: dict[str, Callable[[Surface], str | None]] = {
    "faces": _not_a_mesh,
    "manifold": _not_a_mesh,
    "oriented": _not_a_mesh,
    "connected": _not_a_mesh,
    "disk": _not_a_disk,
    "disk_after_cut": _not_a_mesh,
    "seams": lambda surface: (
        None
        if isinstance(surface, Mesh) and surface.seams is not None
        else "needs a mesh that came with a UV map, for its seams"
    ),
    "points": lambda surface: (
        "takes a point cloud; the surface is a mesh" if isinstance(surface, Mesh) else None
    ),
    "cuda": _cuda_missing,
}
"""Each word of `Method.requires`: the reason why a surface cannot meet it, or None.

What is not `manifold` (at most two faces at an edge, one fan at a vertex), `oriented` (neighbouring
faces turn alike) or `connected` is made so before the method sees it, the same way for every
method, and the row says how (`parapoint.surfaces.preparation`). `disk` takes a disk as it is and
nothing else. `disk_after_cut` asks for all of these and takes what is cut to a disk: a surface that
is one, with or without holes, comes as it is. `seams` admits meshes that came with a UV map, and
the method finds in `Mesh.seams` where that is cut; no other method is shown them. `points` takes
clouds.
"""

REPAIRED = frozenset({"manifold", "oriented", "connected", "disk_after_cut"})
"""The words that `parapoint.surfaces.preparation` makes true of a mesh."""
