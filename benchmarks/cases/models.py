"""The models of the benchmark: where each comes from, what is known about it, and how to load it.

`models.json` is the registry. It has one entry for each file: its address at a commit, its sha256,
its licence, and what was measured on it. `published/` has a
file for each source of published figures, under the names that the models have there.

A model's `claim` says how sure we are that it is the model of a paper: "same model", "likely" or
"stand-in". No public file is proven to be the authors' own, so a measured figure is compared with a
published one only if the claim is "same model" or "likely".

Files come from a local mirror, if PARAPOINT_DATA names one. Otherwise they are downloaded once.
"""

from __future__ import annotations

import difflib
import functools
import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple
from urllib.parse import urlsplit

import platformdirs
import pooch

from benchmarks.cases import derived
from benchmarks.cases.builtin import BUILTIN
from parapoint.errors import InputError
from parapoint.files.reading import FORMATS, read_parameterized, read_surface, read_welded
from parapoint.messages import said_of
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import PointCloud, Surface

MIRROR = "PARAPOINT_DATA"
"""Environment variable that names a folder with the registry's files, such as paper/hand_1.obj."""

CONNECT_SECONDS, READ_SECONDS = 5, 60
"""Seconds that a server may take to answer, and then to send the next bytes."""

Claim = Literal["same model", "likely", "stand-in"]


class PublishedFigure(NamedTuple):
    """A number that a paper prints for a model.

    Attributes:
        paper_name: the model's name in that paper; ParaPoint's name, if papers differ.
        method: the method as the paper calls it.
        metric: our name of the metric.
        value: the number as printed.
        source: paper and table.
        note: how it was obtained, if that matters.
        unit: of the value; "" for a number without one.
        tolerance: difference up to which a measured value reproduces it.
        trust: where we have it from, and what is not known about it.
    """

    paper_name: str
    method: str
    metric: str
    value: float
    source: str
    note: str
    unit: str
    tolerance: float
    trust: str


@dataclass(frozen=True)
class Model:
    """An entry of the registry.

    Attributes:
        name: canonical name, which is the file's without its ending.
        file: path inside a mirror or the cache.
        set: its folder: paper, disk, closed, genus, cad, wild, scans or artist.
        url: the address that it is downloaded from, at a commit.
        sha256: hash of the file.
        size: size of the file in bytes.
        licence: what its source says about its licence.
        source: repository, commit and path.
        note: what is special about it.
        vertices: number of vertices, or of points.
        faces: number of triangles.
        topology: as `Mesh.topology` says it, or "point cloud".
        facts: counts and flags that were measured once, such as euler and duplicate_vertices.
        paper_name: the model of the papers that it stands for; "" for none.
        claim: how sure we are that it is that model; None without a paper_name.
        claim_reason: the reason for the claim, in one sentence.
    """

    name: str
    file: str
    set: str
    url: str
    sha256: str
    size: int
    licence: str
    source: str
    note: str
    vertices: int
    faces: int
    topology: str
    facts: Mapping[str, int | bool] = field(hash=False)
    paper_name: str = ""
    claim: Claim | None = None
    claim_reason: str = ""

    @property
    def published(self) -> tuple[PublishedFigure, ...]:
        """The figures that papers print for the model that this one stands for."""
        return tuple(row for row in published_figures() if row.paper_name == self.paper_name)

    @property
    def has_uv(self) -> bool:
        """Whether the file carries a UV map: `read_parameterized(path(name))` reads it."""
        return bool(self.facts.get("has_uv"))


class MissingModelError(InputError):
    """A model is not in the mirror and cannot be downloaded; the message says how to get it."""


def _data(name: str) -> Any:
    """The content of a JSON file next to, or below, this module."""
    return json.loads(Path(__file__).parent.joinpath(name).read_text(encoding="utf-8"))


@cache
def registry() -> dict[str, Model]:
    """All models by canonical name, in the order of the sets."""
    entries = [Model(**entry) for entry in _data("models.json")]
    return {model.name: model for model in entries}


@cache
def published_figures() -> tuple[PublishedFigure, ...]:
    """All figures of the files in `published/`, source by source.

    Two values agree within the larger of a share of the published one and an absolute difference,
    which each file states: a share for what seeds and iterations change, half of the last digit for
    what printing does.
    """
    found = []
    for path in sorted((Path(__file__).parent / "published").glob("*.json"), reverse=True):
        content = _data(f"published/{path.name}")
        shared = {name: content[name] for name in ("metric", "unit", "trust")}
        for row in content["figures"]:
            tolerance = max(
                content["relative_tolerance"] * row["value"], content["absolute_tolerance"]
            )
            found.append(
                PublishedFigure(
                    paper_name=row["model"],
                    method=row["method"],
                    value=row["value"],
                    source=f"{content['source']}, {row['place']}",
                    note=row.get("note", ""),
                    tolerance=tolerance,
                    **shared,
                )
            )
    return tuple(found)


def names() -> list[str]:
    """The canonical names of all models: those of the registry, then the built-in surfaces."""
    return [*registry(), *BUILTIN]


def canonical_name(case: str) -> str:
    """The full name of a model, or the path of a user's file as given.

    Args:
        case: a name, the beginning of exactly one name, or a path to a file. If more than one
            fits, a whole name comes first, then a file. An @ and what follows stand for a case
            that is made from that model (`benchmarks.cases.derived`).

    Raises:
        InputError: no name or file fits, several names begin so, or the model has no such case.
    """
    known = names()
    if case in known or Path(case).is_file():
        return case
    model, at, how = case.rpartition("@")
    if at:
        name = canonical_name(model)
        derived.check(name, how)
        return f"{name}@{how}"
    begun = [name for name in known if case and name.startswith(case)]
    if len(begun) == 1:
        return begun[0]
    if begun:
        raise InputError(f"model {case!r} may be any of {', '.join(begun)}; give more of the name")
    if os.sep in case or "/" in case or Path(case).suffix.lower() in FORMATS:
        raise InputError(f"{case}: no such file, and no model of that name")
    near = difflib.get_close_matches(case, known, n=3, cutoff=0.4)
    hint = f"the nearest are {', '.join(near)}" if near else "`list cases` names all"
    raise InputError(f"there is no model {case!r}; {hint}")


def _is_derived(name: str) -> bool:
    """Whether a canonical name is that of a case made from a model."""
    return "@" in name and not Path(name).is_file()


def is_made_in_memory(case: str) -> bool:
    """Whether a case is built in or made from a model, rather than a file.

    Raises:
        InputError: as for `canonical_name`.
    """
    name = canonical_name(case)
    return name in BUILTIN or _is_derived(name)


def _model_name(name: str) -> str:
    """The model that a case is made from; for any other case, its own name."""
    return name.rpartition("@")[0] if _is_derived(name) else name


def _derived(name: str) -> tuple[Surface, Surface]:
    """What is made from a model, by its canonical name, and where its points belong on the model.

    Raises:
        InputError: the model has no faces; as for `load`.
    """
    model, _, how = name.rpartition("@")
    return derived.derived(model, load(model), how)


def exact_points(case: str) -> PointCloud | None:
    """The points of a noisy sampled cloud without their noise, on which its maps are scored.

    None for every other case.

    Raises:
        InputError: as for `load`.
        MissingModelError: as for `load`.
    """
    name = canonical_name(case)
    if not _is_derived(name):
        return None
    cloud, exact = _derived(name)
    if not isinstance(cloud, PointCloud) or not isinstance(exact, PointCloud):
        return None
    return exact if (cloud.points != exact.points).any() else None


def reference(case: str) -> Parameterization | None:
    """The UV map that a model of the registry came with; None for any other case.

    Raises:
        InputError: as for `load`.
    """
    model = info(case)
    return read_parameterized(path(case))[1] if model and model.has_uv else None


def info(case: str) -> Model | None:
    """The entry of a case in the registry; None for a built-in surface or a user's file.

    Raises:
        InputError: as for `canonical_name`.
    """
    return registry().get(canonical_name(case))


def load(case: str) -> Surface:
    """The surface of a case: a model of the registry, a built-in surface, or a file.

    The registry's disks stay cut as their authors cut them. In a user's file doubled vertices are
    taken as one, so that the same surface gives the same results from OBJ, PLY and GLB.

    Raises:
        InputError: the name is unknown or ambiguous, or the file cannot be read or is not the one
            that the registry describes.
        MissingModelError: the model is neither in the mirror nor in the cache, and cannot be
            downloaded.
    """
    name = canonical_name(case)
    if name in BUILTIN:
        return BUILTIN[name]()
    if _is_derived(name):
        return _derived(name)[0]
    if name in registry():
        return read_surface(path(name))
    with said_of(name):
        return read_welded(name)


def path(case: str) -> Path:
    """Where the file of a model is: in the mirror or the cache, its hash checked.

    A user's own file stays where it is. The file of a case made from a model is the model's.

    Raises:
        InputError: as for `load`, or for a built-in surface, which has no file.
        MissingModelError: as for `load`.
    """
    name = _model_name(canonical_name(case))
    if name in BUILTIN:
        raise InputError(f"{name} is made in memory and has no file")
    model = registry().get(name)
    if model is None:
        return Path(name)
    return _mirrored(model) or _downloaded(model)


def _mirrored(model: Model) -> Path | None:
    """The model's file in the mirror; None if there is no mirror, or no such file in it."""
    mirror = os.environ.get(MIRROR)
    if not mirror:
        return None
    if not Path(mirror).is_dir():
        raise InputError(f"{MIRROR} names {mirror}, which is no folder")
    file = Path(mirror, model.file)
    if not file.is_file():
        return None
    found = pooch.file_hash(str(file), alg="sha256")
    if found != model.sha256:
        raise InputError(
            f"{file}: is not {model.name}: its sha256 is {found}, not {model.sha256}; "
            "replace or remove it"
        )
    return file


_unreachable: dict[str, str] = {}
"""Hosts that have not answered this process, and why. Twenty models need not wait for one host."""


def cache_folder() -> Path:
    """The folder in which downloads are kept."""
    return Path(platformdirs.user_cache_dir("parapoint", appauthor=False))


def _bound(model: Model, response: Any, **_: Any) -> None:
    """Let a response hand out no more bytes than the model's file has.

    Raises:
        InputError: while it is read: there are more.
    """
    content = response.iter_content

    def bounded(*arguments: Any, **options: Any) -> Iterator[bytes]:
        read = 0
        for chunk in content(*arguments, **options):
            read += len(chunk)
            if read > model.size:
                response.close()
                raise InputError(
                    f"{model.name}: the file at {model.url} is not the registered one: "
                    f"it has more than {model.size} bytes"
                )
            yield chunk

    response.iter_content = bounded


def _downloaded(model: Model) -> Path:
    """The model's file in the cache; it is downloaded if it is not there."""
    from requests import RequestException
    from requests.exceptions import HTTPError

    file = cache_folder() / model.file
    host = urlsplit(model.url).netloc
    pooch.get_logger().setLevel("WARNING")
    if host in _unreachable and not file.is_file():
        raise _missing_model(model, file, _unreachable[host])
    if not file.is_file() and not sys.stderr.isatty():  # a terminal has a bar
        print(f"downloading {model.name}, {model.size / 1e6:.1f} MB", file=sys.stderr, flush=True)
    try:
        pooch.retrieve(
            model.url,
            known_hash=f"sha256:{model.sha256}",
            path=file.parent,
            fname=file.name,
            downloader=pooch.HTTPDownloader(
                progressbar=sys.stderr.isatty(),
                timeout=(CONNECT_SECONDS, READ_SECONDS),
                hooks={"response": functools.partial(_bound, model)},
            ),
        )
    except InputError:  # larger than registered
        raise
    except HTTPError as error:
        raise _missing_model(model, file, str(error)) from error
    except RequestException as error:
        _unreachable[host] = f"{host} does not answer ({type(error).__name__})"
        raise _missing_model(model, file, _unreachable[host]) from error
    except ValueError as error:
        raise InputError(
            f"{model.name}: the file at {model.url} is not the registered one: "
            f"its sha256 is not {model.sha256}"
        ) from error
    return file


def _missing_model(model: Model, file: Path, why: str) -> MissingModelError:
    """The error that says why a model is missing, and how to get it."""
    return MissingModelError(
        f"model {model.name} is not at hand: {model.url} cannot be downloaded: {why}. Either set "
        f"{MIRROR} to a folder that holds {model.file}, or save that address as {file}"
    )


def missing(cases: Iterable[str]) -> dict[str, str]:
    """Download all cases that are missing; those that cannot be downloaded, each with its reason.

    Raises:
        InputError: a name is unknown, or a file is not the one that the registry describes.
    """
    reasons: dict[str, str] = {}
    for case in cases:
        if _model_name(canonical_name(case)) in BUILTIN:
            continue
        try:
            path(case)
        except MissingModelError as error:
            reasons[case] = str(error)
    return reasons
