"""Any program that reads an OBJ file and writes one with UV coordinates."""

from __future__ import annotations

import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np

from parapoint.errors import InputError
from parapoint.files.reading import read_parameterized
from parapoint.method import MissingError, UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface


@dataclass(frozen=True)
class External:
    """An external program: reads an OBJ, writes the same faces with vt.

    The program is started without a shell. It must keep the order of the faces and of their
    corners. A program that takes disks only must say so by its exit status.

    Attributes:
        command: template such as "mytool --in {input} --out {output}", split as a shell would.
    """

    command: str = ""

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    deterministic: ClassVar[bool] = False  # a program makes no promise

    def __post_init__(self) -> None:
        for place in ("{input}", "{output}"):
            if place not in self.command:
                raise InputError(
                    f"the command of an external program needs {place}, "
                    f"as in external(command='tool {{input}} {{output}}'); it is {self.command!r}"
                )

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (a program's seed is part of its command)
        """The map that the program wrote.

        Raises:
            UnsupportedError: the surface is a point cloud.
            MissingError: there is no such program.
            FlatteningError: the program failed, wrote no readable OBJ, or changed the faces.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        words = shlex.split(self.command)
        if which(words[0]) is None:
            raise MissingError(f"needs the program {words[0]}, which is not installed")
        with TemporaryDirectory() as folder:
            source, target = Path(folder, "input.obj"), Path(folder, "output.obj")
            write_bare_obj(source, surface)
            places = {"{input}": str(source), "{output}": str(target)}
            for place, path in places.items():
                words = [word.replace(place, path) for word in words]
            ended = subprocess.run(words, capture_output=True, text=True, check=False)  # noqa: S603 (the user's own command)
            if ended.returncode:
                said = (ended.stderr.strip() or ended.stdout.strip()).splitlines()[-1:]
                raise FlatteningError(
                    f"{words[0]} ended with status {ended.returncode}: {''.join(said)}"
                )
            try:
                mesh, result = read_parameterized(target)
            except InputError as error:
                raise FlatteningError(f"{words[0]} wrote no UV map: {error}") from None
        same = mesh.faces.shape == surface.faces.shape and np.allclose(
            mesh.vertices[mesh.faces],
            surface.vertices[surface.faces],
            rtol=0,
            atol=1e-4
            * np.ptp(
                surface.vertices[surface.referenced], axis=0
            ).max(),  # programs print few digits
        )
        if not same:
            raise FlatteningError(f"{words[0]} changed the faces or their order")
        return result


def write_bare_obj(path: Path, mesh: Mesh) -> None:
    """Write positions and faces to an OBJ file."""
    with path.open("w", encoding="utf-8") as file:
        np.savetxt(file, mesh.vertices, fmt="v %.17g %.17g %.17g")
        np.savetxt(file, mesh.faces + 1, fmt="f %d %d %d")
