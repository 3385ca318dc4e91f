"""Any program that reads an OBJ file and writes one with UV coordinates."""

from __future__ import annotations

import os
import shlex
import subprocess
from dataclasses import dataclass
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory
from typing import ClassVar

import numpy as np
from scipy.spatial import cKDTree

from baselines.tools.recipes import RECIPES, Recipe
from parapoint.errors import InputError
from parapoint.files.reading import read_parameterized
from parapoint.method import MissingError, UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface

ROUNDED = 1e-4
"""Distance, in extents of the surface, by which programs that print few digits move vertices."""


@dataclass(frozen=True)
class External:
    """An external program: reads an OBJ, writes the same faces with vt.

    The program is started without a shell. It may put the faces and their corners in another order
    and repeat vertices, but must not move them. A program that takes disks only must say so by its
    exit status.

    Attributes:
        command: template such as "mytool --in {input} --out {output}", split as a shell would.
        recipe: in place of a command, the name of a known program: see `baselines.tools.recipes`.
    """

    command: str = ""
    recipe: str = ""

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("scipy",)
    deterministic: ClassVar[bool] = False  # a program makes no promise

    def __post_init__(self) -> None:
        if self.recipe:
            if self.command:
                raise InputError("external takes a command or a recipe, not both")
            if self.recipe not in RECIPES:
                known = ", ".join(RECIPES)
                raise InputError(f"there is no recipe {self.recipe!r}; there are: {known}")
            return
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
        recipe = RECIPES[self.recipe] if self.recipe else Recipe(self.command, "", "")
        words = shlex.split(recipe.command)
        if which(words[0]) is None:
            how = f": {recipe.source}" if recipe.source else ", which is not installed"
            raise MissingError(f"needs the program {words[0]}{how}")
        start = os.environ.get(recipe.home) if recipe.home else None
        if recipe.home and not (start and Path(start, words[1]).is_file()):
            raise MissingError(f"needs {words[1]}: {recipe.source}")
        with TemporaryDirectory() as name:
            folder = Path(name, "folder")
            folder.mkdir()
            source, target = Path(name, "input.obj"), Path(name, "output.obj")
            write_bare_obj(source, surface)
            places = {"{input}": source, "{output}": target, "{folder}": folder}
            for place, path in places.items():
                words = [word.replace(place, str(path)) for word in words]
            if self.recipe and start is None:
                start = str(folder)
            ended = subprocess.run(words, capture_output=True, text=True, check=False, cwd=start)  # noqa: S603 (the user's own command)
            if ended.returncode:
                said = (ended.stderr.strip() or ended.stdout.strip()).splitlines()[-1:]
                raise FlatteningError(
                    f"{words[0]} ended with status {ended.returncode}: {''.join(said)}"
                )
            if recipe.result:
                target = next(folder.glob(recipe.result), folder / recipe.result)
            try:
                mesh, result = read_parameterized(target)
            except InputError as error:
                raise FlatteningError(f"{words[0]} wrote no UV map: {error}") from None
        found = in_order(mesh, result, surface)
        if found is None:
            raise FlatteningError(f"{words[0]} changed the faces")
        return found


def in_order(mesh: Mesh, made: Parameterization, surface: Mesh) -> Parameterization | None:
    """A map of a mesh, its faces and corners in the order of a surface that is the same.

    Args:
        mesh: the surface's faces in any order, its vertices renumbered or repeated and rounded.
        made: the map of the mesh.
        surface: the surface.

    Returns:
        None where the mesh has other faces, or a vertex is ROUNDED away from the surface's.
    """
    if mesh.faces.shape != surface.faces.shape:
        return None
    reach = ROUNDED * np.ptp(surface.vertices[surface.referenced], axis=0).max()
    apart = mesh.vertices[mesh.faces] - surface.vertices[surface.faces]
    if np.abs(apart).max() <= reach:
        return made
    places, number = np.unique(surface.vertices, axis=0, return_inverse=True)
    away, nearest = cKDTree(places).query(mesh.vertices[mesh.faces])
    wanted, found = number.reshape(-1)[surface.faces], np.asarray(nearest)
    rows, faces = (np.lexsort(np.sort(of, axis=1).T) for of in (wanted, found))
    if away.max() > reach or (np.sort(wanted[rows]) != np.sort(found[faces])).any():
        return None
    face = np.empty_like(faces)
    face[rows] = faces
    corner = (found[face][:, None, :] == wanted[:, :, None]).argmax(axis=2)
    rows_of_uv = np.take_along_axis(made.corners[face], corner, axis=1)
    return Parameterization(made.uv, rows_of_uv, made.trace, made.report)


def write_bare_obj(path: Path, mesh: Mesh) -> None:
    """Write positions and faces to an OBJ file."""
    with path.open("w", encoding="utf-8") as file:
        np.savetxt(file, mesh.vertices, fmt="v %.17g %.17g %.17g")
        np.savetxt(file, mesh.faces + 1, fmt="f %d %d %d")
