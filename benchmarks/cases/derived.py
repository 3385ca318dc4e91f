"""Cases that are made from a model: clouds sampled from it, and the model cut along a drawn seam.

Such a case is called MODEL@HOW. HOW is "noise=0.01" (a fraction of the diagonal), "uneven", the
name of colours, or "drawn": the model is cut along the seam that somebody drew on it, which is the
edges in the file of `seams/` with the model's name.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.cases.builtin import sampled
from benchmarks.cases.coloured import WAVES, coloured
from parapoint.errors import InputError
from parapoint.surfaces.cutting import cut_along
from parapoint.surfaces.surface import Mesh, Surface

MOST_NOISE = 0.1
"""The most noise that a sampled cloud may have, as a fraction of the model's diagonal."""
DRAWN = "drawn"
"""What stands after the @ of a model that is cut along a drawn seam."""


def is_drawn(case: str) -> bool:
    """Whether a case is a model that is cut along a drawn seam."""
    return case.endswith(f"@{DRAWN}")


def undrawn(case: str) -> str:
    """The model of a case that is cut along a drawn seam; any other case as it is."""
    return case.removesuffix(f"@{DRAWN}")


def seam_file(model: str) -> Path:
    """Where the seam drawn on a model is, if there is one: a line of two vertices for each edge."""
    return Path(__file__).parent / "seams" / f"{model}.txt"


def seam_digest(case: str) -> str:
    """Hash of the seam of a case that is cut along one; "" for any other."""
    if not is_drawn(case):
        return ""
    return hashlib.sha256(seam_file(undrawn(case)).read_bytes()).hexdigest()


def check(model: str, how: str) -> None:
    """Check that there is such a case.

    Raises:
        InputError: the text after the @ asks for nothing that there is.
    """
    if how != DRAWN:
        if how not in WAVES:
            _sampling(how)
    elif not seam_file(model).is_file():
        drawn = ", ".join(sorted(path.stem for path in seam_file(model).parent.glob("*.txt")))
        raise InputError(f"nobody has drawn a seam on {model}; there is one on {drawn}")


def derived(model: str, surface: Surface, how: str) -> tuple[Surface, Surface]:
    """What is made from a model, always the same, and where its points belong on the model.

    Args:
        model: the model's canonical name.
        surface: the model.
        how: the text after the @ of the case.

    Raises:
        InputError: the model has no faces, or there is no such case.
    """
    if not isinstance(surface, Mesh):
        raise InputError(f"{model} has no faces to sample; it is a point cloud already")
    if how == DRAWN:
        edges = np.loadtxt(seam_file(model), dtype=np.int64, ndmin=2)
        mesh = cut_along(surface, edges)
        return mesh, mesh
    if how in WAVES:
        cloud = coloured(surface, WAVES[how])
        return cloud, cloud
    return sampled(surface, **_sampling(how))


def _sampling(how: str) -> dict[str, Any]:
    """The arguments of `sampled` that the text after the @ of a case asks for.

    Raises:
        InputError: the text asks for nothing that there is.
    """
    if how == "uneven":
        return {"is_uneven": True}
    found = re.fullmatch(r"noise=(\d*\.?\d+)", how)
    if found is None or float(found[1]) > MOST_NOISE:
        raise InputError(
            f"a cloud is sampled from a model by MODEL@noise=0.01 (a fraction of the diagonal, "
            f"{MOST_NOISE} at most), MODEL@uneven, or with colours by MODEL@{' or @'.join(WAVES)}, "
            f"not by @{how}"
        )
    return {"noise": float(found[1])}
