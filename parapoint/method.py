"""What a parameterization method is, what it may require, and how a surface is made to fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, Protocol, runtime_checkable

from parapoint.parameterization import Parameterization, PointParameterization
from parapoint.surface import Mesh, PointCloud, Surface


@runtime_checkable
class Method(Protocol):
    """A parameterization method: a dataclass whose fields are its hyperparameters.

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


def _topology_unless(holds: Callable[[Mesh], bool], need: str) -> Callable[[Surface], str | None]:
    """A requirement on a mesh: None where it holds, else the reason with the surface's topology."""

    def reason(surface: Surface) -> str | None:
        if isinstance(surface, PointCloud):
            return "needs faces; the surface is a point cloud"
        return None if holds(surface) else f"needs {need}; the surface is {surface.topology}"

    return reason


def _cuda_missing(_: Surface) -> str | None:
    import torch  # here, so that importing parapoint leaves torch out

    return None if torch.cuda.is_available() else "needs a CUDA device; none is available"


def is_planar_domain(mesh: Mesh) -> bool:
    """Whether the mesh is a disk, with or without holes: it embeds in the plane without a cut."""
    return (
        mesh.is_manifold
        and mesh.is_oriented
        and mesh.component_count == 1
        and len(mesh.boundary_loops) > 0
        and mesh.genus == 0
    )


def is_cuttable(mesh: Mesh) -> bool:
    """Whether `cutting.cut_to_disk` can open the mesh: connected, manifold and oriented."""
    return mesh.is_manifold and mesh.is_oriented and mesh.component_count == 1


REQUIREMENTS: dict[str, Callable[[Surface], str | None]] = {
    "faces": _topology_unless(lambda _: True, "faces"),
    "manifold": _topology_unless(lambda mesh: mesh.is_manifold, "a manifold mesh"),
    "oriented": _topology_unless(lambda mesh: mesh.is_oriented, "consistently oriented faces"),
    "connected": _topology_unless(lambda mesh: mesh.component_count == 1, "a connected mesh"),
    "disk": _topology_unless(lambda mesh: mesh.topology == "disk", "a disk"),
    "disk_after_cut": _topology_unless(
        is_cuttable, "a connected, manifold, consistently oriented mesh (others have no disk cut)"
    ),
    "seams": _topology_unless(
        lambda mesh: mesh.seams is not None, "a mesh that came with a UV map, for its seams"
    ),
    "points": lambda surface: (
        "takes a point cloud; the surface is a mesh" if isinstance(surface, Mesh) else None
    ),
    "cuda": _cuda_missing,
}
"""Each word of `Method.requires`: the reason why a surface does not meet it, or None.

`disk` takes a disk as it is and nothing else. `disk_after_cut` also takes what can be cut to one:
a surface that is no disk (with or without holes) is cut before the method sees it, by the same
automatic cut for every method, and the row says so. `seams` admits meshes that came with a UV map,
and the method finds in `Mesh.seams` where that is cut; no other method is shown them.
"""


def prepared(surface: Surface, requires: frozenset[str]) -> tuple[Surface, str]:
    """`surface` as a method that `requires` these words gets it, and the step taken ("" for none).

    Raises:
        UnsupportedError: the surface does not meet a requirement.
        KeyError: a word is not in REQUIREMENTS.
    """
    for word in sorted(requires):
        reason = REQUIREMENTS[word](surface)
        if reason is not None:
            raise UnsupportedError(reason)
    if "disk_after_cut" in requires and isinstance(surface, Mesh) and not is_planar_domain(surface):
        from parapoint.cutting import cut_to_disk

        return cut_to_disk(surface), "automatic cut to a disk"
    return surface, ""
