"""Blender's UV operators, each map in a process of its own that has Blender as a module."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.tools.atlas import joined_corners
from parapoint.method import MissingError, UnsupportedError
from parapoint.planar.domains import FlatteningError, check_iterations, domain, scaled
from parapoint.surfaces.frame import in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import FloatArray, IntArray, Mesh, Surface

INTERPRETER = "PARAPOINT_BLENDER"
"""Environment variable that names a Python interpreter which can import bpy, where there is one."""
ENVIRONMENT: tuple[str, ...] = () if os.environ.get(INTERPRETER) else ("bpy>=4.3",)
"""What a run must install. There are wheels for a few versions of Python only."""
SCRIPT = Path(__file__).with_name("blender_process.py")
HOW = (
    "python -m benchmarks run installs it in an environment of its own; "
    f"or name a python that can import bpy in {INTERPRETER}"
)


class Blender(NamedTuple):
    """A process that has imported Blender and waits for its one task.

    Attributes:
        process: what it is told and says are lines of JSON.
        version: such as "5.0.1".
    """

    process: subprocess.Popen[str]
    version: str


_waiting: list[Blender] = []


def started() -> Blender:
    """A new process.

    Raises:
        MissingError: there is no such interpreter, or it has no Blender.
    """
    interpreter = os.environ.get(INTERPRETER) or sys.executable
    if which(interpreter) is None:
        raise MissingError(f"needs Blender: there is no program {interpreter}: {HOW}")
    process = subprocess.Popen(  # noqa: S603 (the user's own interpreter, our script)
        [interpreter, "-I", str(SCRIPT)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    said = json.loads(process.stdout.readline() or "{}")
    if "blender" not in said:
        process.communicate()
        why = said.get("missing", f"status {process.returncode}")
        raise MissingError(f"needs Blender: {interpreter} cannot import bpy ({why}): {HOW}")
    return Blender(process, said["blender"])


def unwrapped(
    vertices: FloatArray, faces: IntArray, operator: str, **options: object
) -> tuple[FloatArray, dict[str, object]]:
    """(F, 3, 2) uv of each corner, and the report: Blender's version, seconds of the operator.

    Raises:
        MissingError: there is no Blender.
        UnsupportedError: Blender's check of the mesh would change it.
        FlatteningError: Blender failed or crashed.
    """
    process, version = _waiting.pop() if _waiting else started()
    with TemporaryDirectory() as folder:
        source, target = Path(folder, "mesh.npz"), Path(folder, "uv.npy")
        np.savez(source, vertices=in_unit(vertices, faces), faces=faces)
        task = {"source": str(source), "target": str(target)}
        output, _ = process.communicate(
            json.dumps(task | {"operator": operator, "options": options}) + "\n"
        )
        said = json.loads(output or "{}")
        if "unsupported" in said:
            raise UnsupportedError(said["unsupported"])
        if "seconds" not in said:
            raise FlatteningError(said.get("error", f"Blender ended, status {process.returncode}"))
        uv = np.load(target).astype(np.float64)
    return uv, {"blender": version, "operator_seconds": said["seconds"]}


class Waiting:
    """What the four methods share: their environment, and that Blender starts before the clock.

    Of a surface that comes in several components the first one's start only: the others' count.
    """

    environment: ClassVar[tuple[str, ...]] = ENVIRONMENT

    def preload(self) -> None:
        """Start the process that the next map will use.

        Raises:
            MissingError: there is no Blender.
        """
        _waiting.append(started())


def unwrapped_disk(surface: Surface, **options: object) -> Parameterization:
    """The map of a disk, with or without holes, by `bpy.ops.uv.unwrap`, scaled to the 3D area.

    Blender cuts along seams only and none are set: a closed mesh must come cut.

    Raises:
        UnsupportedError: the surface is no disk, with or without holes; there is no Blender.
        FlatteningError: Blender failed or crashed.
    """
    disk = domain(surface)
    corners, report = unwrapped(disk.vertices, disk.faces, "unwrap", **options)
    uv = np.empty((len(disk.vertices), 2))
    uv[disk.faces] = corners  # no seams: all corners of a vertex have one uv
    return Parameterization(scaled(disk, uv), disk.faces, report=report)


@dataclass(frozen=True)
class BlenderAngleBased(Waiting):
    """Blender's angle-based unwrap (ABF++).

    A. Sheffer et al. 2005, "ABF++: fast and robust angle based flattening".

    Attributes:
        fill_holes: close loops other than the longest for the solve.
    """

    fill_holes: bool = False

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area; raises as `unwrapped_disk`."""
        return unwrapped_disk(surface, method="ANGLE_BASED", fill_holes=self.fill_holes)


@dataclass(frozen=True)
class BlenderConformal(Waiting):
    """Blender's conformal unwrap (LSCM).

    Attributes:
        fill_holes: close loops other than the longest for the solve.
    """

    fill_holes: bool = False

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area; raises as `unwrapped_disk`."""
        return unwrapped_disk(surface, method="CONFORMAL", fill_holes=self.fill_holes)


@dataclass(frozen=True)
class BlenderMinimumStretch(Waiting):
    """Blender's minimum-stretch unwrap (SLIM).

    Attributes:
        iterations: steps of SLIM, at least 1.
        no_flip: keep triangles from flipping where the start has none flipped.
        fill_holes: close loops other than the longest for the solve.
    """

    iterations: int = 10
    no_flip: bool = False
    fill_holes: bool = False

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})

    def __post_init__(self) -> None:
        check_iterations(self.iterations)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The map, scaled to the 3D area; raises as `unwrapped_disk`."""
        return unwrapped_disk(surface, method="MINIMUM_STRETCH", **asdict(self))


@dataclass(frozen=True)
class BlenderSmartProject(Waiting):
    """Blender's smart UV project: faces grouped by their normals, each group projected, packed.

    Takes any mesh that is manifold, as Blender holds no copy of a face: it makes seams of its own.

    Attributes:
        angle_limit: largest angle in degrees between a face's and its group's normal.
        island_margin: room between islands, of the unit square, scaled as Blender does.
        area_weight: 0 to 1, how much large faces count in a group's normal.
    """

    angle_limit: float = 66.0
    island_margin: float = 0.0
    area_weight: float = 0.0

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "manifold"})

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (nothing is random)
        """The atlas in the unit square.

        Raises:
            UnsupportedError: the surface is a point cloud, or has two faces on the same vertices;
                there is no Blender.
            FlatteningError: Blender failed or crashed.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        options = asdict(self) | {"angle_limit": np.radians(self.angle_limit)}
        corners, report = unwrapped(surface.vertices, surface.faces, "smart_project", **options)
        made = joined_corners(surface, corners)
        return Parameterization(made.uv, made.corners, report=report)
