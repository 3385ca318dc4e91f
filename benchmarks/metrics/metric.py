"""What there is to know about a metric: its name, how to read it, and how it is computed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

WITHOUT_SPANNING = "_without_spanning"
"""How the name of a metric ends that leaves out the faces that span a seam."""

Group = Literal[
    "conformal", "authalic", "isometric", "validity", "use", "seams", "reference", "points"
]
GROUPS: dict[Group, str] = {
    "conformal": "angles",
    "authalic": "areas",
    "isometric": "lengths",
    "validity": "flipped, degenerate and overlapping faces",
    "use": "the worst part, and what a texture needs",
    "seams": "seams, charts, packing",
    "reference": "against the reference map",
    "points": "point cloud, no mesh",
}
"""The groups of metrics in the order of the tables, and the title of each."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """One metric.

    Attributes:
        name: its key in results.
        label: the short heading of its column.
        group: the table that it belongs to.
        function: computes it from a MapState, or from a PointMap if the group is "points".
        weighting: how faces, corners or points are weighted.
        source: who defined it.
        unit: "radians", "faces" and so on; "" for a pure number.
        normalization: what the value is relative to; printed with the heading.
        better: whether the lower or the higher of two values is better.
        ideal: the value of a perfect map; None if no map can reach one.
    """

    name: str
    label: str
    group: Group
    function: Callable[[Any], float]
    weighting: str
    source: str
    unit: str = ""
    normalization: str = ""
    better: Literal["lower", "higher"] = "lower"
    ideal: float | None = 0.0

    @property
    def heading(self) -> str:
        """Label, unit and normalization, so that nobody has to guess what a number means."""
        notes = ", ".join(note for note in (self.unit, self.normalization) if note)
        return f"{self.label} ({notes})" if notes else self.label
