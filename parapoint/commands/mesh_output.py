"""What `unwrap` writes of a mesh: its file with new UVs, and what it showed, in a new texture."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from parapoint.commands.output import SIDES, TEXTURE
from parapoint.commands.progress import Tell, baking, untold
from parapoint.files.content import FACE_COLOURS
from parapoint.files.meshes.gltf import opened
from parapoint.files.meshes.materials import libraries, material_names
from parapoint.files.meshes.painting import Painting, painting_of
from parapoint.files.meshes.pictures import Picture, bare_name
from parapoint.files.reading import Polygons, faults_of
from parapoint.files.targets import checked_target
from parapoint.files.writing.gltf_rewriting import check_rewritable, has_colours, rewrite_gltf
from parapoint.files.writing.mesh_writers import (
    write_material,
    write_npz,
    write_picture,
    write_ply,
    write_textured,
)
from parapoint.files.writing.obj_rewriting import rewrite_obj, write_library
from parapoint.files.writing.ply_rewriting import is_rewritable, rewrite_ply
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import BoolArray
from parapoint.textures.baking import LARGEST
from parapoint.textures.checkerboard import checkerboard
from parapoint.textures.repainting import coloured, repainted

logger = logging.getLogger("parapoint")

REWRITTEN = {(".obj", ".obj"), (".ply", ".ply"), (".glb", ".glb"), (".gltf", ".glb")}
"""Endings of an input and an output between which all but the UVs is kept."""
WITHOUT_STRAYS = (".ply", ".glb")
"""Endings of files that are written with the vertices of faces alone."""


@dataclass(frozen=True)
class MeshOutput:
    """What is to be written of a mesh, known before it is unwrapped.

    Attributes:
        given: the mesh as it was read.
        source: the file that it was read from.
        out: the file to write.
        texture: texels along a side of the texture.
        margin: texels around each chart that repeat its edge.
        asked: whether a texture was asked for.
        painting: what the file paints on its triangles, or None.
        chosen: (F,) the triangles that are written, or None for all.
    """

    given: Polygons
    source: Path
    out: Path
    texture: int
    margin: int
    asked: bool
    painting: Painting | None
    chosen: BoolArray | None = None

    @property
    def is_rewritten(self) -> bool:
        """Whether the file is copied with new UVs, and all else stays."""
        pair = (self.source.suffix.lower(), self.out.suffix.lower())
        return pair in REWRITTEN and pair[1] == self._keeper

    @property
    def has_picture(self) -> bool:
        """Whether a picture is written beside the file."""
        ending = self.out.suffix.lower()
        if ending not in SIDES:
            return False
        if self.is_rewritten and ending == ".obj":
            return self.shows_old or not libraries(self.source)[0]
        is_shown = self.shows_old if self.is_rewritten else self.painting is not None
        return ending == ".obj" or self.asked or is_shown

    @property
    def shows_old(self) -> bool:
        """Whether the texture shows what the file painted with pictures on its mesh."""
        return self.painting is not None and self.painting.largest > 0

    def check(self, *, force: bool) -> None:
        """Check all that writing could fail of, before any work.

        Raises:
            InputError: a file beside `out` may not be replaced; the input cannot be written anew.
        """
        if self.has_picture:
            sides = SIDES[self.out.suffix.lower()]
            checked_target(self.out, sides=sides, inputs=[self.source], force=force)
        if self.is_rewritten and self.out.suffix.lower() == ".glb":
            with faults_of(self.source):
                check_rewritable(self.source)
        if self.asked and not self._gets_texture:
            why = (
                "its own colours and materials stay"
                if self.is_rewritten
                else "this format has none"
            )
            logger.warning("%s: no texture is written: %s", self.out, why)

    @property
    def _gets_texture(self) -> bool:
        """Whether a texture of ours is written, beside the file or inside."""
        if self.out.suffix.lower() != ".glb":
            return self.has_picture
        if not self.is_rewritten:
            return True
        tree = opened(self.source).tree
        return not (tree.get("materials") or has_colours(tree))

    @property
    def _tints(self) -> bool:
        """Whether colours of materials and vertices tint pictures, as they do in glTF."""
        return self.source.suffix.lower() in {".glb", ".gltf"}

    def picture(self, placed: Charted, tell: Tell = untold) -> Picture:
        """What the texture shows: what the file does, or a checkerboard."""
        done = baking(tell)
        colours = self.given.colours
        if colours is not None and self.chosen is not None:
            colours = colours[np.unique(self.given.mesh.faces[self.chosen])]
        if self.painting is not None:
            chosen = self.painting if self.chosen is None else self.painting.of_faces(self.chosen)
            return repainted(
                placed,
                chosen,
                self.texture,
                self.margin,
                tints=self._tints,
                colours=colours if self._tints else None,
                done=done,
            )
        if colours is not None:
            return coloured(placed, colours, self.texture, self.margin, done=done)
        return checkerboard(self.texture)

    def write(self, placed: Charted, picture: Picture) -> dict[str, object]:
        """Write the mesh with its map in the unit square; facts of the writing."""
        if self.is_rewritten:
            rewrite: dict[str, Callable[[Charted, Picture], dict[str, object]]] = {
                ".obj": self._rewrite_obj,
                ".ply": self._rewrite_ply,
                ".glb": self._rewrite_gltf,
            }
            return rewrite[self.out.suffix.lower()](placed, picture)
        self._warn_of_extras()
        if self.out.suffix.lower() == ".npz":
            write_npz(self.out, placed)
        elif self.out.suffix.lower() == ".ply" and not self.has_picture:
            write_ply(self.out, placed)
        else:
            write_textured(self.out, placed, picture)
        return {}

    def _rewrite_obj(self, placed: Charted, picture: Picture) -> dict[str, object]:
        named, has_pictures = libraries(self.source)
        material = None
        if not named:
            names = material_names(self.source.read_bytes())[0][1:]
            material = write_material(self.out, picture, [*names, *map(bare_name, names)])
        elif has_pictures:
            material = write_library(self.out, picture if self.shows_old else None, named)
        split = rewrite_obj(
            self.source,
            self.out,
            placed.map,
            self.given.places,
            material=material,
            keeps_libraries=material is None,
        )
        return self._split(split)

    def _rewrite_ply(self, placed: Charted, picture: Picture) -> dict[str, object]:
        name = write_picture(self.out, picture).name if self.has_picture else None
        places = self.given.places
        return self._split(rewrite_ply(self.source, self.out, placed.map, places, picture=name))

    def _rewrite_gltf(self, placed: Charted, picture: Picture) -> dict[str, object]:
        uv_set = rewrite_gltf(self.source, self.out, placed.map, picture[..., :3])
        if uv_set != "TEXCOORD_0":
            logger.warning(
                "%s: its textures keep their own UVs; the new ones are its UV set %s",
                self.out,
                uv_set,
            )
        return {"uv_set": uv_set}

    def _split(self, count: int) -> dict[str, object]:
        """The fact that polygons became triangles, with a warning."""
        if count:
            logger.warning(
                "%s: the seam runs through %d polygons: they became triangles", self.out, count
            )
        return {"polygons_split": count}

    @property
    def _keeper(self) -> str:
        """The ending of a file that would keep all but the UVs; "" for none."""
        own = self.source.suffix.lower()
        if self.chosen is not None or (own == ".ply" and not is_rewritable(self.source)):
            return ""
        return next((out for given, out in REWRITTEN if given == own), "")

    def _warn_of_extras(self) -> None:
        shown = set()
        if self._gets_texture and self.painting is None:
            shown = {"colours"} & set(self.given.extras)
        elif self._gets_texture:
            shown = {"old UVs"} if self.shows_old else {FACE_COLOURS}
            shown |= {"colours"} if self._tints else set()
        left = [name for name in self.given.extras if name not in shown]
        if self.out.suffix.lower() in WITHOUT_STRAYS and not self.given.mesh.referenced.all():
            left.append("vertices without faces")
        if left:
            logger.warning(
                "%s: positions, triangles and new UVs are written%s; left out: %s%s",
                self.out,
                ", what it shows in a texture" if shown else "",
                ", ".join(left),
                f". A {kept} file would keep them" if (kept := self._keeper) else "",
            )


def mesh_output(
    given: Polygons,
    source: str,
    out: str,
    texture: int | None,
    margin: int,
    *,
    chosen: BoolArray | None = None,
) -> MeshOutput:
    """What is to be written of a mesh; its texture is no coarser than the pictures that it shows.

    Raises:
        InputError: a picture of the mesh cannot be read.
    """
    with faults_of(Path(source)):
        painting = painting_of(Path(source), given.polygon_of, given.uv)
    size = texture or min(max(TEXTURE, painting.largest if painting else 0), LARGEST)
    return MeshOutput(
        given,
        Path(source),
        Path(out),
        size,
        margin,
        texture is not None,
        painting,
        chosen,
    )
