"""Which pictures there are of a model and of a map, and what their files are called."""

from __future__ import annotations

import hashlib
import re

from benchmarks.store.rows import ResultRow
from reports.tables.published import published_values


def slug(text: str) -> str:
    """`text` as a part of a file name; a short hash is added where characters had to go."""
    plain = re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:60]
    if plain == text.lower():
        return plain
    return f"{plain}-{hashlib.sha256(text.encode()).hexdigest()[:6]}".strip("-")


MODEL_PICTURES = ("mesh-1", "mesh-2")

TEXTURED_PICTURES = ("checker-1", "checker-2", "layout")

HEAT_PICTURES = ("angle", "angle-uv", "area", "area-uv")

ARTIST_PICTURES = ("artist-checker-1", "artist-layout")

CLOUD_PICTURES = ("cloud", "cloud-uv", "dense", "seams")

CURVES = "curves"
"""Kind of the file beside the pictures that holds what figures draw of a map as curves."""

VIEWED = "view"
"""Kind of the file beside the pictures that the viewer reads, of a model and of a map."""


def model_kinds(*, points: bool, artist: bool) -> tuple[str, ...]:
    """The files of a model: of `points`, the `artist`'s own map if there is one."""
    return MODEL_PICTURES + (VIEWED,) * (not points) + ARTIST_PICTURES * artist


def map_kinds(row: ResultRow, *, points: bool, with_heat: bool) -> tuple[str, ...]:
    """The files of a map, of `points` or of a mesh: of both, for the one method that sees points.

    In a report without the figures of a model the second view of other methods is in none, and only
    the paper's models are shown as points.
    """
    if points:
        return CLOUD_PICTURES
    second_view = with_heat or row.method in {"slim", "parapoint"}
    as_points = row.method == "parapoint" and (with_heat or bool(published_values(row.case)))
    return (
        *(kind for kind in TEXTURED_PICTURES if second_view or kind != "checker-2"),
        *(*HEAT_PICTURES, CURVES) * with_heat,
        *CLOUD_PICTURES * as_points,
        VIEWED,
    )


def model_file(case: str, kind: str) -> str:
    """File name of a picture of a model, or of what the viewer reads."""
    return f"{slug(case)}.{kind}.{_ending(kind)}"


def map_file(row: ResultRow, kind: str) -> str:
    """File name of a picture of a map, or of what the viewer reads."""
    return f"{slug(row.case)}.{slug(row.method)}.{row.id[:8]}.{kind}.{_ending(kind)}"


def _ending(kind: str) -> str:
    return {VIEWED: "js", CURVES: "json"}.get(kind, "webp")
