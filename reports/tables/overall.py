"""An overall order that no single mean can be gamed by: the share of pairs that a method wins.

On each model every two methods are a pair, won by one of them or shared:

1. Validity comes first: the better grade wins (usable, flawed, collapsed, broken, no map at all).
2. Of two maps of one grade, the better value wins, half of the pair by each criterion: angles and
   areas, unless a reader chooses others. Within the metric's tolerance it is shared. Two broken
   maps share; two collapsed ones are compared by angles alone.

A method's share is the mean over the models of its share of the pairs there. The models are the
sample: the interval is Student's over their shares, as when classifiers are compared over data sets
(Demšar, Statistical Comparisons of Classifiers over Multiple Data Sets, 2006). A method's place is
one more than the number of methods whose whole interval lies above its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.metrics.grades import GRADES
from reports.contents import ANGLE, AREA, POINT_ANGLE, POINT_AREA, Contents, number
from reports.ranking import may_rank, tolerance
from reports.tables.notes import environment_note, method_notes
from reports.tables.statistics import half_width
from reports.tables.table import METHOD, Column, Table, Value, metric_column

CRITERIA = {
    "angles": (ANGLE, POINT_ANGLE),
    "areas": (AREA, POINT_AREA),
    "time": ("cpu_seconds", "cpu_seconds"),
}
"""What a pair is compared by: the metric on a mesh, and on a cloud of points."""
COUNTED = ("angles", "areas")
"""The criteria that count unless a reader chooses others."""
LOST, SHARED, WON = 0, 1, 2
"""How a pair ends for its first method, in halves."""
Halves = npt.NDArray[np.int8]


def outcome(
    one: Mapping[str, object] | None, other: Mapping[str, object] | None, metric: str
) -> int:
    """How a pair ends for `one`: LOST, SHARED or WON.

    Args:
        one: its record on the model (`Contents.records`); None where it has no cell.
        other: its rival's.
        metric: what two maps of one grade are compared by.
    """
    here, there = validity(one), validity(other)
    if here != there:
        return WON if here > there else LOST
    column = metric_column(metric)
    grade = str(one["grade"]) if one else ""
    a, b = number(one, metric), number(other, metric)
    if a is None or b is None or not may_rank(grade, angles=column.angles):
        return SHARED
    if a == b or abs(a - b) <= tolerance(metric) * min(abs(a), abs(b)):
        return SHARED
    return WON if (a < b) == (column.better == "lower") else LOST


def validity(record: Mapping[str, object] | None) -> int:
    """0 for no map, then one more for each better grade; a map without a grade counts as broken."""
    if record is None or not record["ok"]:
        return 0
    grades: Sequence[str] = GRADES
    return 1 + (grades.index(str(record["grade"])) if record["grade"] in grades else 0)


def halves(contents: Contents, criterion: str) -> Halves:
    """(models, methods, methods): how each pair ends for the first by a criterion, in halves."""
    shorts = [label.short for label in contents.methods]
    found = np.full((len(contents.cases), len(shorts), len(shorts)), SHARED, dtype=np.int8)
    for c, case in enumerate(contents.cases):
        metric = CRITERIA[criterion][case in contents.clouds]
        records = [contents.records.get((case, short)) for short in shorts]
        for i, one in enumerate(records):
            for j, other in enumerate(records[:i]):
                found[c, i, j] = outcome(one, other, metric)
                found[c, j, i] = WON - found[c, i, j]
    return found


class Share(NamedTuple):
    """A method's share of the pairs.

    Attributes:
        method: its short name.
        share: mean over the models, 0 to 1.
        half: half of its confidence interval; NaN for one model.
        place: from 1; methods whose intervals overlap may share one.
    """

    method: str
    share: float
    half: float
    place: int


def shares(contents: Contents) -> list[Share]:
    """The share of each method with one chart, best first; none where there are fewer than two."""
    own = [n for n, label in enumerate(contents.methods) if label.short not in contents.unranked]
    if len(own) < 2:
        return []
    won = np.mean([halves(contents, name) for name in COUNTED], axis=0)[:, own][:, :, own] / WON
    every = (won.sum(axis=2) - 0.5) / (len(own) - 1)  # nobody meets itself: that half is no pair
    found = [
        (contents.methods[n].short, float(column.mean()), min(half_width(column), 1.0))
        for n, column in zip(own, every.T, strict=True)
    ]
    found.sort(key=lambda one: -one[1])
    return [
        Share(name, share, half, place(share, half, [(b, c) for _, b, c in found]))
        for name, share, half in found
    ]


def place(share: float, half: float, others: Sequence[tuple[float, float]]) -> int:
    """One more than the number of `others`, shares with half intervals, that lie wholly above."""
    own = 0.0 if math.isnan(half) else half
    return 1 + sum(
        other - (0.0 if math.isnan(width) else width) > share + own for other, width in others
    )


def overall(contents: Contents) -> Table | None:
    """The overall order; None with fewer than two methods of one chart."""
    found = shares(contents)
    if not found:
        return None
    counts = contents.means.groupby("label")["grade"].value_counts()
    rows: list[Mapping[str, Value]] = [
        {
            "place": float(one.place),
            "method": one.method,
            "share": one.share,
            "half": one.half,
            **{grade: float(counts.get((one.method, grade), 0)) for grade in GRADES},
        }
        for one in found
    ]
    return Table(
        name="overall",
        title="Overall: share of pairs won",
        caption=(
            "On each model every two methods with one chart are a pair. The better grade wins "
            "(usable, flawed, collapsed, broken, no map); of two maps of one grade the better "
            "value wins, half of the pair by angles, half by areas, and within the metric's "
            "tolerance it is shared; of two collapsed ones areas are not compared, of two broken "
            "ones nothing. The share is a mean over the models, with its 95 % interval over them "
            "(Student; Demšar 2006). A place is one more than the number of methods whose whole "
            "interval lies above."
        ),
        columns=(
            Column("place", "place", digits=0),
            METHOD,
            Column("share", "pairs won", digits=1, percent=True),
            Column("half", "± 95 %", digits=1, percent=True),
            *(Column(grade, grade, digits=0, group="maps") for grade in reversed(GRADES)),
        ),
        blocks=(tuple(rows),),
        notes=(*method_notes(contents), environment_note(contents)),
    )
