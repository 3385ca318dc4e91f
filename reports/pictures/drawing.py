"""The rendered pictures of a report: each model, and each map on its model and in the plane.

They are the expensive part, so they are kept: a picture is drawn again only if the surface, the map
or the source of the renderer has changed.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from benchmarks.rendering.maps import FIELDS, SAMPLES
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.files.targets import write_text
from parapoint.sources import source_hash
from parapoint.surfaces.surface import PointCloud
from reports.contents import Contents
from reports.pictures import clouds
from reports.pictures.names import ARTIST_PICTURES, map_file, map_kinds, model_file, model_kinds
from reports.pictures.portraits import Portrait, save
from reports.pictures.workers import done_by_several
from reports.progress import QUIET, Progress

SIZE, SMALL = 360, 280
"""Longer side of a picture in pixels: what the largest figure of a model prints, and enough for the
others, of reports with too many models for such figures.
"""


def draw(contents: Contents, folder: Path, jobs: int, progress: Progress = QUIET) -> list[str]:
    """Draw the pictures of the suite that `folder` lacks; what could not be drawn, and why.

    `jobs` processes share the models; `progress` hears of each.
    """
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "keys.json"
    known = known_keys(record)
    source = source_hash(__name__)
    with_heat = not contents.is_large
    work: list[tuple[list[ResultRow], list[str]]] = []
    keys: dict[str, str] = {}
    for case in contents.cases:
        rows = [row for row in contents.rows if row.case == case and row.surface_hash]
        if not rows:
            continue
        todo: list[ResultRow] = []
        missing: list[str] = []
        latest, points = rows[-1], case in contents.clouds
        artist = contents.store.reference_path(latest.surface_hash).exists()
        names = [model_file(case, kind) for kind in model_kinds(points=points, artist=artist)]
        wanted = dict.fromkeys(names, (latest, str(artist)))
        for row in rows:
            if row.status == "ok":
                own = map_kinds(row, points=points, with_heat=with_heat)
                files = (map_file(row, kind) for kind in own)
                wanted |= dict.fromkeys(files, (row, row.uv_sha256))
        for name, (row, content) in wanted.items():
            text = f"{source} {with_heat} {row.surface_hash} {content}"
            keys[name] = hashlib.sha256(text.encode()).hexdigest()[:16]
            if known.get(name) != keys[name] or not (folder / name).exists():
                missing.append(name)
                if row not in todo:
                    todo.append(row)
        if todo:
            work.append((todo, missing))
    work.sort(key=lambda one: _size(contents.store, one[0]), reverse=True)
    faults: list[str] = []
    wanting = itertools.chain.from_iterable(missing for _, missing in work)
    done = {name: keys[name] for name in keys.keys() - set(wanting)}
    make = partial(draw_model, contents.store.folder, folder, with_heat)
    parts = done_by_several(make, work, jobs)
    made = progress.track(parts, f"{contents.suite}: pictures of models", len(work))
    for (_, missing), (failed, said) in zip(work, made, strict=True):
        faults += said
        done |= {name: keys[name] for name in set(missing).difference(failed)}
        _note(record, known | done)  # a report that is stopped goes on where it was
    for name in known.keys() - done.keys():  # of a cell that gave way to a newer one
        (folder / name).unlink(missing_ok=True)
    _note(record, done)
    return faults


def _size(store: Store, rows: Sequence[ResultRow]) -> int:
    """How much there is to draw: bytes of the model, as often as it is drawn.

    The largest work comes first, lest it be left to one process while the others have none.
    """
    path = store.surface_path(rows[0].surface_hash)
    return len(rows) * path.stat().st_size if path.exists() else 0


def _note(record: Path, keys: Mapping[str, str]) -> None:
    """Keep what `known_keys` is to return."""
    write_text(record, json.dumps(keys, indent=0, sort_keys=True) + "\n")


PLAIN_NAME = re.compile(r"\w[\w.+-]*")
"""Names that may stand in a record of what was drawn: no folders, nothing hidden."""


def known_keys(record: Path) -> dict[str, str]:
    """The keys of what was drawn before; none where the file is missing or damaged.

    A folder of results may come from elsewhere, and these names become those of files: what is not
    the plain name of a file in this very folder is left out.
    """
    try:
        content = json.loads(record.read_bytes())
    except (OSError, ValueError):
        return {}
    if not isinstance(content, dict):
        return {}
    return {name: key for name, key in content.items() if PLAIN_NAME.fullmatch(name)}


def draw_model(
    results: Path, folder: Path, with_heat: bool, rows: list[ResultRow], missing: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Draw the maps of `rows` and, if files of it are `missing`, their model.

    The files that could not be drawn, and why.
    """
    store = Store(results)
    case = rows[0].case
    artist = store.reference_path(rows[-1].surface_hash).exists()
    failed: list[str] = []
    faults: list[str] = []

    def files_of(row: ResultRow, points: bool) -> list[str]:
        own = map_kinds(row, points=points, with_heat=with_heat)
        return [map_file(row, kind) for kind in own if row.status == "ok"]

    try:
        surface = store.surface(rows[-1])
    except InputError as error:
        everything = [model_file(case, kind) for kind in model_kinds(points=False, artist=artist)]
        everything += [name for row in rows for name in files_of(row, points=False)]
        return everything, [f"{case}: no pictures: {error}"]
    points = isinstance(surface, PointCloud)
    size = SIZE if with_heat else SMALL
    subject = (
        clouds.Portrait(surface, size, SAMPLES, FIELDS)
        if isinstance(surface, PointCloud)
        else Portrait(surface, size)
    )
    kinds = model_kinds(points=points, artist=artist)
    if not {model_file(case, kind) for kind in kinds}.isdisjoint(missing):
        for kind, content in subject.model().items():
            save(content, folder / model_file(case, kind))
    if not {model_file(case, kind) for kind in ARTIST_PICTURES}.isdisjoint(missing):
        try:
            made = subject.map(store.reference(rows[-1]), ("checker-1", "layout"))
            for kind, content in zip(ARTIST_PICTURES, made.values(), strict=True):
                save(content, folder / model_file(case, kind))
        except InputError as error:
            failed += [model_file(case, kind) for kind in ARTIST_PICTURES]
            faults.append(f"{case}: no picture of the artist's map: {error}")
    for row in rows:
        if row.status != "ok":
            continue
        try:
            result = store.result(row)
            kinds = map_kinds(row, points=points, with_heat=with_heat)
            of_map = (
                subject.map(result, kinds, clouds.points_used(row))
                if isinstance(subject, Portrait)
                else subject.map(result, kinds)
            )
            for kind, content in of_map.items():
                save(content, folder / map_file(row, kind))
        except InputError as error:
            failed += files_of(row, points)
            faults.append(f"{case}, {row.method}: no pictures: {error}")
    return failed, faults
