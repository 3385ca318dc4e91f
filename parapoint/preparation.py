"""How a surface is made to fit a method: the same steps for every method, and their names."""

from __future__ import annotations

from parapoint.cutting import cut_to_disk
from parapoint.method import REQUIREMENTS, UnsupportedError
from parapoint.surface import Mesh, Surface


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
    if "disk_after_cut" in requires and isinstance(surface, Mesh) and not surface.is_planar_domain:
        return cut_to_disk(surface), "automatic cut to a disk"
    return surface, ""
