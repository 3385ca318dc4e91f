"""`python -m benchmarks.checks.fuzzing TARGET`: feed every reader with bytes that no program wrote.

A target takes bytes as the content of a file. It may return, or raise InputError. Any other
exception is a finding, and so is an input of up to a million bytes that takes more than a second of
processor time or 200 megabytes (`score` measures what it reads, and may take more). atheris
(libFuzzer) changes valid files, guided by the branches of the Python code that they reach, and
keeps each input that made a finding. The tests do the same for a short time, without guidance.
"""

from __future__ import annotations

import contextlib
import functools
import io
import logging
import random
import resource
import struct
import sys
import tempfile
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import numpy as np

from parapoint import console
from parapoint.errors import InputError
from parapoint.files.reading import FORMATS, UV_FORMATS

LONGEST = 4096
"""Longest input that atheris makes, in bytes."""
SECONDS = 1.0
"""Processor time that an input of up to a million bytes may take, in seconds."""
MEGABYTES = 200
"""Memory by which a process may grow, whatever it is fed, in units of 10^6 bytes."""
SCORE_SECONDS, SCORE_MEGABYTES = 20.0, 600
"""The same for `score`, which measures up to 250,000 faces that lie on one another."""
TABLES = ("runs.jsonl", "environment.json", "surfaces.json", "metrics.parquet")
STORE_FILES = (*TABLES, "uv", "surface")
"""Parts of a results folder. The first byte of an input to `store` says which one it replaces."""


class Finding(Exception):  # noqa: N818  not an error of this program
    """An input was too slow, or took too much memory."""


def read_as(ending: str, data: bytes) -> None:
    """Read `data` as a file of that ending: its surface, and its map where it may carry one."""
    from parapoint.files.reading import read_parameterized, read_surface

    path = _scratch() / f"input{ending}"
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        read_surface(path)
    if ending in UV_FORMATS:
        with contextlib.suppress(InputError):
            read_parameterized(path)


def score(data: bytes) -> None:
    """Score `data` as an OBJ file, or as an NPZ file where it is an archive."""
    from benchmarks.commands.score import map_state
    from benchmarks.metrics import evaluation
    from parapoint.files.reading import read_point_map

    path = _scratch() / ("map.npz" if data.startswith(b"PK") else "map.obj")
    path.write_bytes(data)
    with contextlib.suppress(InputError):
        if path.suffix == ".npz":
            evaluation.evaluate_points(*read_point_map(path))
        else:
            evaluation.values(map_state(path))


def store(data: bytes) -> None:
    """Read and check a results folder in which `data`, without its first byte, replaces a file."""
    from benchmarks.store import measuring, verifying
    from benchmarks.store.results import Store

    folder, row_id, surface_hash = _results()
    name = STORE_FILES[data[0] % len(STORE_FILES)] if data else STORE_FILES[0]
    places = {"uv": f"uv/{row_id}.npz", "surface": f"surfaces/{surface_hash}.npz"}
    path = folder / places.get(name, name)
    before = path.read_bytes()
    path.write_bytes(data[1:])
    try:
        with contextlib.suppress(InputError):
            results = Store(folder)
            list(verifying.faults(results))
            results.surface_hashes()
            measuring.metrics(results)
            with results.writing():
                results.rows()
    finally:
        path.write_bytes(before)
        if name != "runs.jsonl":  # whose torn lines have been set aside
            (folder / "runs.torn").unlink(missing_ok=True)


def model(data: bytes) -> None:
    """Load a saved model in which `data`, without its first byte, replaces a file."""
    from parapoint.estimator import load

    files = sorted(_model().iterdir())
    path = files[(data[0] if data else 0) % len(files)]
    before = path.read_bytes()
    path.write_bytes(data[1:])
    try:
        with contextlib.suppress(InputError):
            load(_model())
    finally:
        path.write_bytes(before)


@functools.cache
def _model() -> Path:
    """The folder of a small model."""
    from parapoint import ComputedMap

    points = np.random.default_rng(0).normal(size=(150, 3))
    ComputedMap(points=120).fit(points / np.linalg.norm(points, axis=1, keepdims=True)).save(
        _scratch() / "model"
    )
    return _scratch() / "model"


TARGETS: dict[str, Callable[[bytes], None]] = {
    **{ending[1:]: functools.partial(read_as, ending) for ending in FORMATS},
    "score": score,
    "store": store,
    "model": model,
}
"""The targets by name: the reader of each ending, `score`, a results folder, a saved model."""
HOSTILE = (
    *(b"", b"-1", b"0", b"1e999", b"nan", b"999999999999", b"\xff" * 4, b"\x7f" * 8, b"\n" * 3),
    *(struct.pack("<I", 2**31), struct.pack("<Q", 10**12), b"../../etc/passwd"),
)
"""Pieces that are put into files: numbers and bytes that readers may not expect."""
LARGE = 1_000_000
"""Size to which some files grow by repetition, in bytes."""


def guarded(target: Callable[[bytes], None], data: bytes) -> None:
    """Give `data` to `target`.

    Raises:
        Finding: it took too long, or the process has grown too large.
        Exception: whatever the target raises.
    """
    began = time.process_time()
    target(data)
    seconds = time.process_time() - began
    most = (SCORE_SECONDS, SCORE_MEGABYTES) if target is score else (SECONDS, MEGABYTES)
    if seconds > most[0]:
        raise Finding(f"{seconds:.1f} s for {len(data)} bytes")
    grown = _peak_megabytes() - _first_megabytes()
    if grown > most[1]:
        raise Finding(f"{grown:.0f} MB more than at the start, after {len(data)} bytes")


def _peak_megabytes() -> float:
    """Peak resident memory of this process."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


@functools.cache
def _first_megabytes() -> float:
    """Peak resident memory of this process when this was first asked, before the first input."""
    return _peak_megabytes()


@functools.cache
def _scratch() -> Path:
    """A folder for the files of this process, in memory where the system allows."""
    shared = Path("/dev/shm")  # noqa: S108  the folder made in it is private
    folder = tempfile.TemporaryDirectory(dir=shared if shared.is_dir() else None)
    _kept.append(folder)
    return Path(folder.name)


_kept: list[tempfile.TemporaryDirectory[str]] = []
"""Folders that are removed when the process ends."""


@functools.cache
def _results() -> tuple[Path, str, str]:
    """A results folder with one cell, the id of its row, and the hash of its surface."""
    from benchmarks.cases.suites import Suite
    from benchmarks.checks import instant
    from benchmarks.running import runner
    from benchmarks.store.results import Store

    folder = _scratch() / "results"
    mesh = _scratch() / "mesh.off"
    mesh.write_bytes(seeds("off")[0])
    suite = Suite("fuzz", "A folder to damage", (str(mesh),), (), (0,))
    runner.run(suite, folder, plugins=[f"{instant.__file__}:Instant"])
    (row,) = Store(folder).rows()
    return folder, row.id, row.surface_hash


def _functions(*packages: str) -> Iterator[types.FunctionType]:
    """The functions and methods of all modules of these packages that are imported."""
    for name, module in list(sys.modules.items()):
        if any(f"{name}.".startswith(f"{package}.") for package in packages):
            for value in list(vars(module).values()):
                members = vars(value).values() if isinstance(value, type) else [value]
                for member in members:
                    if isinstance(member, types.FunctionType) and member.__module__ == name:
                        yield member


def seeds(target: str) -> list[bytes]:
    """Small valid inputs, with which the fuzzer starts."""
    if target == "model":
        files = sorted(_model().iterdir())
        return [bytes([n]) + path.read_bytes() for n, path in enumerate(files)]
    if target == "store":
        folder, row_id, surface_hash = _results()
        names = [*TABLES, f"uv/{row_id}.npz", f"surfaces/{surface_hash}.npz"]
        return [bytes([n]) + (folder / name).read_bytes() for n, name in enumerate(names)]
    return _file_seeds()[target]


def _file_seeds() -> dict[str, list[bytes]]:
    """A square of two triangles in every format, by ending."""
    import laspy
    import trimesh

    export: Any = trimesh.exchange.gltf.export_gltf  # untyped, as the next
    textured: Any = trimesh.visual.TextureVisuals
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    mesh = trimesh.Trimesh(points, faces, visual=textured(uv=points[:, :2]), process=False)
    plain = trimesh.Trimesh(points, faces, process=False)
    rows = "\n".join(f"{x} {y} {z}" for x, y, z in points)
    header = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\n"
    header += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 4\nDATA "
    floats = points.astype("<f4").tobytes()
    columns = points.T.astype("<f4").tobytes()
    packed = b"".join(bytes([15]) + columns[k : k + 16] for k in range(0, 48, 16))
    las = laspy.create(point_format=0, file_version="1.2")
    las.xyz = points
    stream = io.BytesIO()
    las.write(stream)
    obj = "".join(f"v {x} {y} {z}\nvt {x} {y}\n" for x, y, z in points)
    obj += "f 1/1 2/2 3/3\nf -4/-4 -2/-2 -1/-1 # seen from the end\n"
    strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    ply = "ply\nformat ascii 1.0\nelement vertex 4\n"
    ply += "".join(f"property float {name}\n" for name in "xyz") + strips + rows + "\n4 0 1 2 3\n"
    off = f"OFF\n4 1 0\n{rows}\n4 0 1 2 3\n"
    counts = np.array([4, 1, 0], ">i4").tobytes(), np.array([4, 0, 1, 2, 3, 0], ">i4").tobytes()
    binary_off = b"OFF BINARY\n" + counts[0] + points.astype(">f4").tobytes() + counts[1]
    archive = io.BytesIO()
    np.savez(archive, points=points, uv=points[:, :2])
    tree = export(trimesh.Scene(mesh), embed_buffers=True)
    return {
        "obj": [obj.encode()],
        "ply": [ply.encode(), _exported(plain, "ply")],
        "off": [off.encode(), binary_off],
        "stl": [_exported(plain, "stl"), _exported(plain, "stl_ascii")],
        "glb": [_exported(mesh, "glb")],
        "gltf": [tree["model.gltf"]],
        "xyz": [rows.encode(), rows.replace(" ", ",").encode()],
        "txt": [rows.replace(" ", "\t").encode()],
        "csv": [f"x,y,z\n{rows.replace(' ', ',')}".encode()],
        "asc": [rows.encode()],
        "pts": [f"4\n{rows}\n".encode()],
        "pcd": [
            f"{header}ascii\n{rows}\n".encode(),
            f"{header}binary\n".encode() + floats,
            f"{header}binary_compressed\n".encode() + struct.pack("<II", 51, 48) + packed,
        ],
        "las": [stream.getvalue()],
        "laz": [stream.getvalue()],
        "npz": [archive.getvalue()],
        "score": [obj.encode(), archive.getvalue()],
    }


def _exported(mesh: Any, kind: str) -> bytes:
    """The content of a file that trimesh writes of a mesh."""
    content = mesh.export(file_type=kind)
    return content.encode() if isinstance(content, str) else bytes(content)


def changed(data: bytes, draw: random.Random) -> bytes:
    """`data` with bytes replaced at up to four places; some of it repeated to a million bytes."""
    for _ in range(draw.randrange(1, 5)):
        at = draw.randrange(len(data) + 1)
        piece = draw.choice([*HOSTILE, draw.randbytes(draw.randrange(1, 9))])
        data = data[:at] + piece + data[at + draw.randrange(9) :]
    if data and draw.random() < 0.1:
        low, high = sorted(draw.randrange(len(data) + 1) for _ in range(2))
        piece = data[low:high] or b"0 "
        data = data[:high] + piece * (LARGE // len(piece)) + data[high:]
    return data


def unguided(minutes: float, seed: int) -> int:
    """Feed all targets in turn with changed seeds until time is over; the number of findings."""
    draw = random.Random(seed)  # noqa: S311  no secret
    given = {name: seeds(name) for name in TARGETS}
    _first_megabytes()
    counts, slowest = dict.fromkeys(TARGETS, 0), dict.fromkeys(TARGETS, 0.0)
    findings = 0
    end = time.monotonic() + 60 * minutes
    while time.monotonic() < end:
        for name, target in TARGETS.items():
            data = changed(draw.choice(given[name]), draw)
            began = time.process_time()
            try:
                guarded(target, data)
            except Exception as error:  # noqa: BLE001  every exception is a finding
                findings += 1
                kept = Path(tempfile.mkdtemp()) / f"finding.{name}"
                kept.write_bytes(data)
                print(f"{name}: {type(error).__name__}: {error} ({kept})", flush=True)
            counts[name] += 1
            slowest[name] = max(slowest[name], time.process_time() - began)
    for name, count in counts.items():
        print(f"{name:6} {count:8} inputs, at most {slowest[name]:.2f} s")
    grown = _peak_megabytes() - _first_megabytes()
    print(f"{sum(counts.values())} inputs, {findings} findings, {grown:.0f} MB more at the peak")
    return findings


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("target", type=click.Choice(["all", *TARGETS]))
@click.option("--runs", type=click.IntRange(1), default=100_000, show_default=True)
@click.option("--seconds", type=click.IntRange(1), help="End after so long.  [default: never]")
@click.option("--seed", type=click.IntRange(1), default=1, show_default=True)
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("results/fuzz"),
    show_default=True,
    help="Keeps what inputs were worth keeping, and findings.",
)
@click.option("--minutes", type=click.FloatRange(0, min_open=True), default=15, show_default=True)
@click.pass_context
def main(
    ctx: click.Context,
    target: str,
    *,
    runs: int,
    seconds: int | None,
    seed: int,
    out: Path,
    minutes: float,
) -> None:
    """Feed a TARGET with RUNS inputs; ends with an error at the first finding.

    With `all`, feed each for its part of MINUTES with inputs that nothing guides, and count.
    """
    if target == "all":
        logging.disable(logging.CRITICAL)
        if unguided(minutes, seed):
            ctx.exit(1)
        return
    try:
        import atheris
    except ImportError:
        raise InputError(
            "needs the package atheris: python -m pip install -e '.[fuzz]' (Linux)"
        ) from None
    logging.disable(logging.CRITICAL)
    corpus = out / target
    corpus.mkdir(parents=True, exist_ok=True)
    for n, data in enumerate(seeds(target)):
        (corpus / f"seed{n}").write_bytes(data)
    for function in _functions("parapoint", "benchmarks", "trimesh.exchange.stl", "laspy"):
        atheris.instrument_func(function)
    run = functools.partial(guarded, TARGETS[target])
    arguments = [f"-runs={runs}", f"-seed={seed}", f"-max_len={LONGEST}", "-timeout=60"]
    arguments.append(f"-max_total_time={seconds or 0}")
    atheris.Setup([sys.argv[0], *arguments, f"-artifact_prefix={out}/{target}-", str(corpus)], run)
    atheris.Fuzz()


if __name__ == "__main__":
    console.run(main)
