"""The models of the benchmark: where each comes from, what is claimed about it, how to load it.

`models.json` is the registry: one entry a file, with its address at a commit, sha256, licence and
what was measured on it. `published.json` holds the figures that papers print, by the name that a
model has there. Which model stands for which of theirs, and how sure that is, is a model's
`claim`: "same model", "likely" or "stand-in". No public file is proven to be the authors' own, so
a measured figure is only judged against a published one where the claim is one of the first two.

Files come from a local mirror, if PARAPOINT_DATA names one, or from the network, once.
"""

from __future__ import annotations

import difflib
import json
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple
from urllib.parse import urlsplit

import platformdirs
import pooch

from benchmarks.cases.builtin import BUILTIN, sampled
from parapoint.errors import InputError
from parapoint.files.reading import FORMATS, read_surface
from parapoint.surfaces.surface import Mesh, PointCloud, Surface

MIRROR = "PARAPOINT_DATA"
"""Environment variable that names a folder with the registry's files, such as paper/hand_1.obj."""

MOST_NOISE = 0.1
"""Most noise that a sampled cloud may have."""
CONNECT_SECONDS, READ_SECONDS = 5, 60

Claim = Literal["same model", "likely", "stand-in"]


class PublishedFigure(NamedTuple):
    """A number that a paper prints for a model.

    Attributes:
        paper_name: the model's name in that paper (in ParaPoint's, where it has several).
        method: the method as the paper calls it.
        metric: the metric's name here.
        value: the number as printed.
        source: paper and table.
        note: how it was obtained, where that matters.
    """

    paper_name: str
    method: str
    metric: str
    value: float
    source: str
    note: str = ""


@dataclass(frozen=True)
class Model:
    """An entry of the registry.

    Attributes:
        name: canonical name, the file's without its ending.
        file: path under a mirror or the cache.
        set: the folder: paper, disk, closed, genus, cad, wild, scans or artist.
        url: where it is downloaded from, at a commit.
        sha256: hash of the file.
        size: bytes.
        licence: what its source says about it.
        source: repository, commit and path.
        note: what is special about it.
        vertices: number of vertices, or of points.
        faces: number of triangles.
        topology: as `Mesh.topology` says it, or "point cloud".
        facts: counts and flags that were measured once (euler, genus, duplicate_vertices, ...).
        paper_name: the model of the papers that it stands for, or "".
        claim: how sure it is that this is that model; None without a paper_name.
        claim_reason: why, in one sentence.
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
        """Figures that papers print for the model this one stands for."""
        return tuple(row for row in published_figures() if row.paper_name == self.paper_name)

    @property
    def has_uv(self) -> bool:
        """Whether the file carries a UV map: `read_parameterized(path(name))` reads it."""
        return bool(self.facts.get("has_uv"))


class MissingModelError(InputError):
    """A model that is neither in the mirror nor to be had from the network; says how to get it."""


def _data(name: str) -> Any:
    """A JSON file beside this module."""
    return json.loads(Path(__file__).with_name(name).read_text(encoding="utf-8"))


@cache
def registry() -> dict[str, Model]:
    """All models by canonical name, in the order of the sets."""
    entries = [Model(**entry) for entry in _data("models.json")]
    return {model.name: model for model in entries}


@cache
def published_figures() -> tuple[PublishedFigure, ...]:
    """All figures of `published.json`."""
    return tuple(PublishedFigure(**row) for row in _data("published.json"))


def names() -> list[str]:
    """Canonical names: the registry's, then the built-in surfaces'."""
    return [*registry(), *BUILTIN]


def canonical_name(case: str) -> str:
    """The full name of a model, or the path of a user's file as given.

    Args:
        case: a name, any beginning that only one name has, or a path to a file. A full name goes
            before a file of that name, a file before a beginning. With "@noise=0.01" or "@uneven"
            after it: a cloud sampled from that model (`benchmarks.cases.builtin.sampled`).

    Raises:
        InputError: no name or file, or a beginning of several names; no such cloud.
    """
    known = names()
    if case in known or Path(case).is_file():
        return case
    model, at, how = case.rpartition("@")
    if at:
        _sampling(how)
        return f"{canonical_name(model)}@{how}"
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


def _sampling(how: str) -> dict[str, Any]:
    """The arguments of `sampled` that stand after the @ of a case.

    Raises:
        InputError: they cannot be read.
    """
    if how == "uneven":
        return {"is_uneven": True}
    found = re.fullmatch(r"noise=(\d*\.?\d+)", how)
    if found is None or float(found[1]) > MOST_NOISE:
        raise InputError(
            f"a cloud is sampled from a model by MODEL@noise=0.01 (a fraction of the diagonal, "
            f"{MOST_NOISE} at most) or MODEL@uneven, not by @{how}"
        )
    return {"noise": float(found[1])}


def _is_sampled(name: str) -> bool:
    """Whether a canonical name is that of a sampled cloud."""
    return "@" in name and not Path(name).is_file()


def is_made_in_memory(case: str) -> bool:
    """Whether a case is a built-in surface or a sampled cloud, and no file.

    Raises:
        InputError: as for `canonical_name`.
    """
    name = canonical_name(case)
    return name in BUILTIN or _is_sampled(name)


def _model_name(name: str) -> str:
    """The name of the model that a sampled cloud is made of; of all others the name itself."""
    return name.rpartition("@")[0] if _is_sampled(name) else name


def _sampled(name: str) -> tuple[PointCloud, PointCloud]:
    """The sampled cloud of a canonical name, and where its points belong on the model.

    Raises:
        InputError: the model has no faces; as for `load`.
    """
    model, _, how = name.rpartition("@")
    mesh = load(model)
    if not isinstance(mesh, Mesh):
        raise InputError(f"{model} has no faces to sample; it is a point cloud already")
    return sampled(mesh, **_sampling(how))


def exact_points(case: str) -> PointCloud | None:
    """Where the points of a noisy sampled cloud belong, there its maps are scored; else None.

    Raises:
        InputError: as for `load`.
        MissingModelError: as for `load`.
    """
    name = canonical_name(case)
    if not _is_sampled(name):
        return None
    cloud, exact = _sampled(name)
    return exact if (cloud.points != exact.points).any() else None


def info(case: str) -> Model | None:
    """The registry's entry; None for a built-in surface or a user's file.

    Raises:
        InputError: as for `canonical_name`.
    """
    return registry().get(canonical_name(case))


def load(case: str) -> Surface:
    """The surface of a case: a model of the registry, a built-in surface, or a file.

    Raises:
        InputError: unknown or ambiguous name; a file that cannot be read or is not the one that
            the registry describes.
        MissingModelError: the model is not at hand and cannot be downloaded.
    """
    name = canonical_name(case)
    if name in BUILTIN:
        return BUILTIN[name]()
    if _is_sampled(name):
        return _sampled(name)[0]
    return read_surface(path(name))


def path(case: str) -> Path:
    """Where the file of a model is, hash checked: in the mirror, in the cache, or downloaded now.

    A user's file is where it is; of a sampled cloud it is the model's. Built-in surfaces have none.

    Raises:
        InputError: as for `load`; or a built-in surface.
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
    """The model's file in the mirror, or None without a mirror or without the file."""
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
"""Hosts that did not answer in this process, and why: twenty models need not wait for one."""


def cache_folder() -> Path:
    """Where downloads are kept."""
    return Path(platformdirs.user_cache_dir("parapoint", appauthor=False))


def _downloaded(model: Model) -> Path:
    """The model's file in the cache, downloaded if it is not there."""
    from requests import RequestException
    from requests.exceptions import HTTPError

    file = cache_folder() / model.file
    host = urlsplit(model.url).netloc
    pooch.get_logger().setLevel("WARNING")
    if host in _unreachable and not file.is_file():
        raise _missing_model(model, file, _unreachable[host])
    try:
        pooch.retrieve(
            model.url,
            known_hash=f"sha256:{model.sha256}",
            path=file.parent,
            fname=file.name,
            downloader=pooch.HTTPDownloader(
                progressbar=sys.stderr.isatty(), timeout=(CONNECT_SECONDS, READ_SECONDS)
            ),
        )
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
    return MissingModelError(
        f"model {model.name} is not at hand: {model.url} cannot be downloaded: {why}. Either set "
        f"{MIRROR} to a folder that holds {model.file}, or save that address as {file}"
    )


def missing(cases: Iterable[str]) -> dict[str, str]:
    """Cases that cannot be had, with the reason; all others are downloaded and at hand after it.

    Raises:
        InputError: unknown name; a file of the mirror or the network is not the registered one.
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
