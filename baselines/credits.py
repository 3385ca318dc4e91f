"""Whom to credit for a method: the licence of what runs, and what to cite, as BibTeX."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

OURS = "MIT"
LIBIGL = f"{OURS}, on libigl (MPL-2.0)"
BLENDER = "GPL-3.0-or-later (Blender), in a process of its own"
MESHLAB = "GPL-3.0 (PyMeshLab)"


class Credit(NamedTuple):
    """Whom to credit for a method.

    Attributes:
        licence: of what runs.
        keys: of the entries of `citations.bib`.
    """

    licence: str
    keys: tuple[str, ...] = ()


CREDITS = {
    "tutte": Credit(LIBIGL, ("tutte1963", "libigl")),
    "harmonic": Credit(LIBIGL, ("pinkall1993", "eck1995", "libigl")),
    "mean_value": Credit(OURS, ("floater2003",)),
    "lscm": Credit(LIBIGL, ("levy2002", "libigl")),
    "abf": Credit(LIBIGL, ("sheffer2005", "libigl")),
    "arap": Credit(LIBIGL, ("liu2008", "libigl")),
    "slim": Credit(LIBIGL, ("rabinovich2017", "libigl")),
    "smith_schaefer": Credit(OURS, ("smith2015",)),
    "geometry_image": Credit(LIBIGL, ("gu2002", "yoshizawa2004", "libigl")),
    "bff": Credit(LIBIGL, ("sawhney2017", "libigl")),
    "xatlas": Credit("MIT (xatlas)", ("xatlas", "sander2003")),
    "uvatlas": Credit("MIT (UVAtlas, by Open3D)", ("zhou2004",)),
    "uvunwrap": Credit("MIT (uvunwrap)"),
    "blender_angle_based": Credit(BLENDER, ("sheffer2005", "blender")),
    "blender_conformal": Credit(BLENDER, ("levy2002", "blender")),
    "blender_minimum_stretch": Credit(BLENDER, ("blender",)),
    "blender_smart_project": Credit(BLENDER, ("blender",)),
    "meshlab_lscm": Credit(MESHLAB, ("levy2002", "cignoni2008")),
    "meshlab_harmonic": Credit(MESHLAB, ("pinkall1993", "cignoni2008")),
    "meshlab_voronoi": Credit(MESHLAB, ("cignoni2008",)),
    "meshlab_triangles": Credit(MESHLAB, ("cignoni2008",)),
    "unwrap": Credit(LIBIGL, ("rabinovich2017", "libigl")),
    "seamster": Credit(LIBIGL, ("sheffer2002", "rabinovich2017", "libigl")),
    "erickson_har_peled": Credit(LIBIGL, ("erickson2004", "rabinovich2017", "libigl")),
    "da_wand": Credit(LIBIGL, ("liu2023", "levy2002", "liu2008", "libigl")),
    "automatic+slim": Credit(LIBIGL, ("rabinovich2017", "libigl")),
    "artist+slim": Credit(LIBIGL, ("rabinovich2017", "libigl")),
    "meshed": Credit(MESHLAB, ("kazhdan2013", "bernardini1999", "cignoni2008")),
    "textured": Credit(
        f"{OURS}; {MESHLAB} and MIT (xatlas) for what is usual today",
        ("kazhdan2013", "bernardini1999", "cignoni2008", "xatlas"),
    ),
    "external": Credit("that of the program"),
    "parapoint": Credit(OURS, ("zhang2024parapoint",)),
    "computed": Credit(LIBIGL, ("libigl",)),
    "fam": Credit(OURS, ("zhang2024fam",)),
    "foldingnet": Credit(OURS, ("yang2018",)),
    "atlasnet": Credit(OURS, ("groueix2018",)),
    "diffsr": Credit(OURS, ("bednarik2020",)),
    "elestruc": Credit(OURS, ("deprelle2019",)),
    "gtif": Credit(OURS, ("chen2020",)),
    "tearingnet": Credit(OURS, ("pang2021",)),
    "flattening_net": Credit(OURS, ("zhang2023flattening",)),
    "reggeonet": Credit(OURS, ("zhang2022reggeonet",)),
    "nuvo": Credit(OURS, ("srinivasan2023",)),
    "nsm": Credit(LIBIGL, ("morreale2021", "rabinovich2017", "libigl")),
}
"""By registry name. A plugin says its own as class attributes, `licence` and `citation`."""


@functools.cache
def entries() -> dict[str, str]:
    """The entries of `citations.bib` by their keys."""
    text = Path(__file__).with_name("citations.bib").read_text(encoding="utf-8")
    found = re.findall(r"^@\w+\{([^,\s]+),.*?^\}$", text, flags=re.DOTALL | re.MULTILINE)
    parts = re.findall(r"^@\w+\{.*?^\}$", text, flags=re.DOTALL | re.MULTILINE)
    return dict(zip(found, parts, strict=True))


def cited(keys: Sequence[str]) -> tuple[str, ...]:
    """The entries of these keys, as BibTeX."""
    return tuple(entries()[key] for key in keys)
