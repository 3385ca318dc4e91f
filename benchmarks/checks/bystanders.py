"""Run random commands in folders full of a user's files, none of which may change.

The files have names like those that our commands write. A command may refuse with status 2 and one
line, it may add files, and it may replace the file that `--out` names. It may do nothing else.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from parapoint.testing import irregular_disk

NAMES = (
    *("model.json", "model-1a2b3c4d.safetensors", "checkpoint.json", "checkpoint-500/optimizer.pt"),
    *("checkpoint-0a1b2c3d.safetensors", "component-0/checkpoint.json", "cells/0/map.npz"),
    *(".parapoint-cells/notes.txt", ".parapoint-1-2.part", "runs.jsonl", "runs.torn", "lock"),
    *("environment.json", "surfaces.json", "metrics.parquet", "uv/0123456789abcdef.npz"),
    *("surfaces/0123456789abcdef.npz", "references/a.npz", "exact/a.npz", "report/index.html"),
    *("report/figures/paper/keys.json", "report/assets/page.js", "report/tables/mine.csv"),
    *("map.mtl", "map.png", "map_.png", "out.png", "preview.png", "map.obj.part", "keys.json"),
    *("map.npz", "texture.png", "captions.md", "index.html"),
)
"""Names of files that a user may have where our commands write."""
COMMANDS = (
    "parapoint fit {cloud} --out {folder} --points 120",
    "parapoint fit {cloud} --out {folder} --preset paper --points 120 --subset 100 --iterations 2",
    "parapoint map {model} {cloud} --out {folder}/map.obj",
    "parapoint map {model} {mesh} --out {folder}/map.ply",
    "parapoint map {model} {cloud} --out {folder}/written.npz --force",
    "parapoint unwrap {mesh} --out {folder}/map.obj",
    "parapoint unwrap {mesh} --out {folder}/map.ply --texture 16",
    "parapoint unwrap {mesh} --out {folder}/new.glb --texture 16 --preview {folder}/seen.png",
    "parapoint unwrap {cloud} --out {folder}/new.obj --texture 16",
    "parapoint bake {model} {cloud} --out {folder}/baked.png --map position --texture 32",
    "benchmarks run --cases {mesh} --methods tutte --out {folder}",
    "benchmarks run --cases {mesh},{missing} --methods tutte,lscm --out {folder}",
    "benchmarks run --cases {cloud} --methods tutte --out {results}",
    "benchmarks check {folder}",
    "benchmarks check {results}",
    "benchmarks score {mesh} --heatmap {folder}/heat.png",
    "reports {folder}",
    "reports {results}",
    "benchmarks list cases",
)
"""The commands, of `parapoint` or of a module, with the places of their files in braces."""


@dataclass
class Count:
    """What the commands did.

    Attributes:
        runs: the number of commands that ran.
        refused: the number of them that ended with status 2.
        files: the number of the user's files that were compared, over all runs.
        faults: a line for each file that was changed or removed, and for each command that ended
            with a status that it may not have.
    """

    runs: int
    refused: int
    files: int
    faults: list[str]


def undisturbed(folder: Path, *, count: int, seed: int) -> Count:
    """Run `count` random commands, each in a folder with random files of the user's.

    Args:
        folder: an empty folder.
        count: the number of commands.
        seed: decides every choice.
    """
    draw = random.Random(seed)  # noqa: S311  no secret
    found = Count(0, 0, 0, [])
    given = inputs(folder / "inputs")
    for number in range(count):
        place = folder / f"run{number}"
        places = {"folder": place / "mine", "results": place / "results", **given}
        shutil.copytree(folder / "inputs" / "results", places["results"])
        for below in (places["folder"], places["results"]):
            _fill(below, draw)
        before = dict(hashes(place))
        before |= dict(hashes(folder / "inputs"))
        command = draw.choice(COMMANDS).format(**places)
        status = _status(command, place)
        now = dict(hashes(place)) | dict(hashes(folder / "inputs"))
        ours = _ours(places["results"])
        for path, content in before.items():
            if path not in ours and now.get(path) != content:
                done = "changed" if path in now else "removed"
                found.faults.append(f"{command}: {path.relative_to(folder)} was {done}")
        if status not in (0, 1 if " check " in command else 0, 2):
            found.faults.append(f"{command}: ended with status {status}")
        found.runs += 1
        found.refused += status == 2
        found.files += len(before)
        shutil.rmtree(place)
    return found


def inputs(folder: Path) -> dict[str, Path]:
    """A mesh, a cloud, a model fitted to it and a folder of results, made by our own commands."""
    folder.mkdir(parents=True)
    mesh, rng = irregular_disk(), np.random.default_rng(0)
    rows = [f"v {x} {y} {z}" for x, y, z in mesh.vertices]
    rows += [f"vt {x} {y}" for x, y in mesh.vertices[:, :2]]
    rows += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in mesh.faces + 1]
    (folder / "mesh.obj").write_text("\n".join(rows))
    points = rng.normal(size=(150, 3))
    np.savetxt(folder / "cloud.xyz", points / np.linalg.norm(points, axis=1, keepdims=True))
    names = {"mesh": "mesh.obj", "cloud": "cloud.xyz", "model": "model", "missing": "no.obj"}
    given = {name: folder / file for name, file in names.items()}
    for command in (
        "parapoint fit {cloud} --out {model} --points 120",
        "benchmarks run --cases {mesh} --methods tutte --out {results}",
    ):
        _status(command.format(**given, results=folder / "results"), folder)
    return given


def _fill(folder: Path, draw: random.Random) -> None:
    """Put some of the user's files into a folder, without replacing any that is there."""
    for name in draw.sample(NAMES, draw.randrange(3, len(NAMES))):
        path = folder / name
        with contextlib.suppress(FileExistsError, NotADirectoryError):
            path.parent.mkdir(parents=True, exist_ok=True)
            if not path.exists():
                path.write_bytes(draw.choice([b"", b"mine\n", b"{}", draw.randbytes(200)]))


def _ours(results: Path) -> set[Path]:
    """The files of a results folder that a run may append to or write anew."""
    names = ("runs.jsonl", "environment.json", "surfaces.json", "metrics.parquet", "lock")
    return {results / name for name in names}


def hashes(folder: Path) -> Iterator[tuple[Path, str]]:
    """Each file below a folder with the hash of its content."""
    for path in folder.rglob("*"):
        if path.is_file():
            yield path, hashlib.sha256(path.read_bytes()).hexdigest()


def _status(command: str, folder: Path) -> int:
    """Run a command in a folder and return its exit status."""
    root = str(Path(__file__).parents[2])
    done = subprocess.run(  # noqa: S603  our own commands
        [sys.executable, *arguments(command)],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": root},
        capture_output=True,
        check=False,
    )
    return done.returncode


def arguments(command: str) -> list[str]:
    """What Python is started with to run a command of `COMMANDS`."""
    program, *given = command.split()
    code = "from parapoint.cli import main; main()"
    return [*(["-c", code] if program == "parapoint" else ["-m", program]), *given]
