"""Maps that somebody else has made, by any tool, as rows that we score; nothing of theirs is run.

A submission is a folder of OBJ files with UVs, each named by its case: `hand_1_i_f5000.obj`. Its
faces are those of the model, in the same order. All files are checked before anything is written.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cases import models
from benchmarks.cases.derived import is_drawn
from benchmarks.cases.suites import Suite
from benchmarks.store.archives import arrays_hash, disk_said, map_arrays, write_arrays
from benchmarks.store.results import Store
from benchmarks.store.rows import SUBMITTED, ResultRow, identity
from parapoint.console import printable
from parapoint.errors import InputError
from parapoint.files.reading import read_parameterized
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, Mesh, Surface

ENDING = ".obj"
LONGEST_NAME = 80
"""Characters that the name of a submitted method may have."""
SAME_PLACE = 1e-5
"""How far a corner may lie from the model's, as a fraction of the model's largest extent: tools
print six digits, and Shay et al. allow as much."""
NO_MAP = "no map was submitted"
"""Reason of the row of a case that a submission lacks."""


@dataclass(frozen=True)
class Submitted:
    """A map of a submission that fits its model.

    Attributes:
        case: the model's name.
        mesh: the model.
        result: the map.
        digest: hash of the file.
    """

    case: str
    mesh: Mesh
    result: Parameterization
    digest: str


@dataclass(frozen=True)
class Submission:
    """A folder of maps.

    Attributes:
        method: what its method is called.
        maps: those that fit.
        missing: the cases of the suite that it has no file for.
        clouds: the cases of the suite that are clouds of points, of which nobody submits a mesh.
    """

    method: str
    maps: list[Submitted]
    missing: list[str]
    clouds: list[str]


def named(method: str) -> str:
    """The name of a submitted method, which is text and nothing else.

    Raises:
        InputError: it is empty, too long, or has letters that cannot be shown.
    """
    name = " ".join(method.split())
    if not name or len(name) > LONGEST_NAME or printable(name) != name:
        raise InputError(
            f"a method is called by 1 to {LONGEST_NAME} letters that can be printed, not {name!r}"
        )
    return name


def read(folder: Path, method: str, suite: Suite) -> Submission:
    """Read and check the maps of a submission.

    Raises:
        InputError: there is no such folder, or it has no map of the suite; a file is named by no
            case of it, or has no map of its model. The message names every such file.
    """
    name = named(method)
    if not folder.is_dir():
        fault = "is no folder" if folder.exists() else "no such folder"
        raise InputError(f"{folder}: {fault}; a submission is a folder of OBJ files")
    files = {path.stem: path for path in sorted(folder.iterdir()) if path.suffix.lower() == ENDING}
    faults = [
        f"{files[stem].name}: no case of {suite.name}" for stem in files.keys() - {*suite.cases}
    ]
    maps: list[Submitted] = []
    missing: list[str] = []
    clouds: list[str] = []
    for case in suite.cases:
        if case not in files:
            is_cloud = "@" in case and not is_drawn(case)
            (clouds if is_cloud else missing).append(case)
            continue
        try:
            maps.append(_fitting(case, files[case]))
        except InputError as error:
            faults.append(str(error).removeprefix(f"{folder}/"))
    if faults:
        raise InputError(f"{folder} is refused, nothing is written: {'; '.join(sorted(faults))}")
    if not maps:
        raise InputError(
            f"{folder} has no map of {suite.name}; name its files by case, such as "
            f"{suite.cases[0]}{ENDING}"
        )
    return Submission(name, maps, missing, clouds)


def _fitting(case: str, path: Path) -> Submitted:
    """The map of a model in a file.

    Raises:
        InputError: the file cannot be read, or is not a map of this model.
    """
    model = models.load(case)
    mesh, result = read_parameterized(path)
    if fault := difference(model, mesh):
        raise InputError(f"{path}: {fault}")
    assert isinstance(model, Mesh)
    if not np.ptp(result.uv[result.corners].reshape(-1, 2), axis=0).all():
        raise InputError(f"{path}: all UVs lie on one line; there is no map to score")
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return Submitted(case, model, result, digest)


def difference(model: Surface, mesh: Mesh) -> str:
    """How the faces of a submitted mesh differ from the model's; "" where they are the same."""
    if not isinstance(model, Mesh):
        return "the model is a cloud of points, and a map of a mesh is none of it"
    if len(mesh.faces) != len(model.faces):
        return f"has {len(mesh.faces):,} faces, and the model has {len(model.faces):,}"
    here, there = mesh.vertices[mesh.faces], model.vertices[model.faces]
    reach = SAME_PLACE * float(np.ptp(there.reshape(-1, 3), axis=0).max())
    away = np.abs(here - there).max(axis=(1, 2)) > reach
    if not away.any():
        return ""
    how = _how(here, there, reach)
    return f"{int(away.sum()):,} of {len(away):,} faces are not the model's: {how}"


def _how(here: FloatArray, there: FloatArray, reach: float) -> str:
    """In which way (F, 3, 3) corners differ, as far as it can be told."""
    for signs in itertools.product((1, -1), repeat=3):
        for axes in itertools.permutations(range(3)):
            turned = there[..., axes] * signs
            if (np.abs(here - turned) <= reach).all():
                matrix = np.eye(3)[list(axes)] * np.array(signs)[:, None]
                kind = "mirrored" if np.linalg.det(matrix) < 0 else "turned by other axes"
                return f"it is {kind}"
    away, nearest = cKDTree(there.mean(axis=1)).query(here.mean(axis=1))
    if (away <= reach).all() and len(np.unique(nearest)) == len(nearest):
        own = (nearest == np.arange(len(nearest))).all()
        return f"{'the corners of its faces' if own else 'its faces'} are in another order"
    return "its vertices are shuffled or moved, or it is another model"


def rows(store: Store, submission: Submission, suite: Suite, run: int) -> list[ResultRow]:
    """Store the maps of a submission, inside `writing()`; a row for each case of the suite.

    A case without a map has a row that says so.

    Args:
        store: where the models and the maps go.
        submission: what `read` has checked.
        suite: its suite.
        run: the entry of the store's environment.

    Raises:
        InputError: the disk is full.
    """
    found = []
    for one in submission.maps:
        row = _row(
            submission,
            suite,
            one.case,
            surface=store.add_surface(one.mesh),
            digest=one.digest,
            run=run,
        )
        if (reference := models.reference(one.case)) is not None:
            store.add_reference(row.surface_hash, reference)
        arrays = map_arrays(one.result)
        path = store.uv_path(row.id)
        with disk_said(path):
            write_arrays(path, arrays)
        file, digest = f"uv/{row.id}.npz", arrays_hash(arrays)
        found.append(dataclasses.replace(row, status="ok", uv_file=file, uv_sha256=digest))
    for case in submission.missing:
        row = _row(submission, suite, case, surface="", digest="0" * 64, run=run)
        found.append(dataclasses.replace(row, reason=NO_MAP))
    return found


def _row(
    submission: Submission, suite: Suite, case: str, *, surface: str, digest: str, run: int
) -> ResultRow:
    """The row of a case before it has a map: its identity alone."""
    about = {
        "suite": suite.name,
        "case": case,
        "method": SUBMITTED,
        "params": {"name": submission.method},
        "seed": 0,
        "source_hash": digest,
        "surface_hash": surface,
    }
    row_id = identity(**about)  # type: ignore[arg-type]  # the fields of an identity
    return ResultRow(id=row_id, status="skipped", run=run, **about)  # type: ignore[arg-type]
