"""A glTF file written anew as GLB with other UVs, all else as it was."""

from __future__ import annotations

import json
import logging
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from parapoint.errors import InputError
from parapoint.files.meshes.gltf import Gltf, opened
from parapoint.files.meshes.gltf_primitives import draws_triangles
from parapoint.files.png import png
from parapoint.files.targets import complete_file
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import IntArray

TRIANGLES = 4
"""glTF's number of the mode of triangles."""
VERTEX_BUFFER, INDEX_BUFFER = 34962, 34963
FLOAT, WHOLE = 5126, 5125
"""glTF's numbers of float32 and uint32."""
DATA = {"accessor", "attributes", "buffer", "bufferView", "indices"}
"""Keys under which extensions, as those of compression, number buffers, views and accessors."""
TABLES = {"EXT_structural_metadata", "EXT_mesh_features", "EXT_instance_features"}
"""Extensions of tables that lie in buffer views, or point into such tables."""
KINDS = {b"\x89PNG": "image/png", b"RIFF": "image/webp", b"\xabKTX": "image/ktx2"}
"""What glTF calls an image, by its first bytes; "image/jpeg" with any others."""

logger = logging.getLogger("parapoint")


def check_rewritable(source: Path) -> None:
    """Check that a glTF file can be written anew.

    Raises:
        InputError: a node draws instances of its mesh, which would need a map each.
    """
    nodes = opened(source).tree.get("nodes", [])
    if any("EXT_mesh_gpu_instancing" in node.get("extensions", {}) for node in nodes):
        raise InputError("draws instances of one mesh; make them meshes of their own, or write OBJ")


def rewrite_gltf(
    source: Path,
    out: Path,
    parameterization: Parameterization,
    picture: npt.NDArray[np.uint8],
) -> str:
    """Copy a glTF file as GLB with new UVs; the name of the set that holds them.

    Where a material shows a picture through the file's own UVs, these stay, and the new ones are a
    further set. Otherwise they are the first. Nodes that share a mesh get a mesh each, since each
    has a place of its own in the map. A file without materials gets one that shows `picture`, but
    where vertices have colours, which would tint it.

    Args:
        source: the .glb or .gltf file that was read.
        out: the GLB file that is written; it appears only when it is complete.
        parameterization: a map of the scene's triangles, in the order of the reader.
        picture: (H, W, 3) pixels for a file without materials.
    """
    scene = opened(source)
    tree = scene.tree
    _drop_extensions(tree)
    placed = scene.placed_primitives()
    uv_set = _free_set(tree)
    made = _Made(scene)
    if not (tree.get("materials") or has_colours(tree)):
        made.add_material(picture)
    primitives = []
    begin = 0
    for one in placed:
        primitive = one.primitive
        if not draws_triangles(primitive):
            primitives.append(primitive)
            continue
        faces = scene.triangles(primitive)
        corners = parameterization.corners[begin : begin + len(faces)]
        begin += len(faces)
        if np.linalg.det(one.transform[:3, :3]) < 0:  # the reader turned them round
            corners = corners[:, ::-1]
        primitives.append(made.primitive(primitive, faces, corners, parameterization.uv, uv_set))
    _place(scene, [one.node for one in placed], iter(primitives))
    data = made.file()
    with complete_file(out) as file:
        file.write(data)
    return uv_set


def _place(
    scene: Gltf, nodes: list[dict[str, Any] | None], primitives: Iterator[dict[str, Any]]
) -> None:
    """Put the new primitives into the meshes; of a mesh that several nodes share, into copies."""
    meshes = scene.tree["meshes"]
    if nodes[0] is None:
        for mesh in meshes:
            mesh["primitives"] = [next(primitives) for _ in mesh["primitives"]]
        return
    done: set[int] = set()
    for node in {id(node): node for node in nodes}.values():
        assert node is not None
        if node["mesh"] in done:
            meshes.append(dict(meshes[node["mesh"]]))
            node["mesh"] = len(meshes) - 1
        done.add(node["mesh"])
        mesh = meshes[node["mesh"]]
        mesh["primitives"] = [next(primitives) for _ in mesh["primitives"]]


def _drop_extensions(tree: dict[str, Any]) -> None:
    """Drop the extensions that name data by number, since these are numbered anew; a line tells."""
    held = list(_extensions(tree))
    names = {name for of in held for name, value in of.items() if name in TABLES or _has_key(value)}
    for of in held:
        for name in names & of.keys():
            del of[name]
    for key in ("extensionsUsed", "extensionsRequired"):
        left = [name for name in tree.pop(key, []) if name not in names]
        tree |= {key: left} if left else {}
    if names:
        logger.warning("left out of the copy, which is plain: %s", ", ".join(sorted(names)))


def _extensions(value: Any) -> Iterator[dict[str, Any]]:
    """The extensions of each part of the JSON, by name."""
    if isinstance(value, dict) and isinstance(held := value.get("extensions"), dict):
        yield held
    for part in value.values() if isinstance(value, dict) else value:
        if isinstance(part, dict | list):
            yield from _extensions(part)


def _has_key(value: Any) -> bool:
    """Whether a part of the JSON has a key of DATA."""
    if isinstance(value, dict):
        return not DATA.isdisjoint(value) or any(map(_has_key, value.values()))
    return isinstance(value, list) and any(map(_has_key, value))


def has_colours(tree: dict[str, Any]) -> bool:
    """Whether vertices have colours."""
    of = (primitive["attributes"] for mesh in tree["meshes"] for primitive in mesh["primitives"])
    return any("COLOR_0" in attributes for attributes in of)


def _free_set(tree: dict[str, Any]) -> str:
    """The name of the UV set for a new map."""
    if not _has_textures(tree.get("materials", [])):
        return "TEXCOORD_0"
    of = [primitive["attributes"] for mesh in tree["meshes"] for primitive in mesh["primitives"]]
    taken = {name for attributes in of for name in attributes}
    return next(name for k in range(len(taken) + 1) if (name := f"TEXCOORD_{k}") not in taken)


def _has_textures(value: Any) -> bool:
    """Whether a material, or a part of one, names a texture."""
    if isinstance(value, dict):
        named = any(name.endswith("Texture") for name in value)
        return named or any(_has_textures(part) for part in value.values())
    return isinstance(value, list) and any(_has_textures(part) for part in value)


class _Made:
    """A glTF file while it is written: the JSON of a scene, and the bytes of its new views."""

    def __init__(self, scene: Gltf) -> None:
        self.scene = scene
        self.tree = scene.tree
        self.views: dict[int, bytes] = {}

    def add_material(self, picture: npt.NDArray[np.uint8]) -> None:
        """Let all primitives show a picture."""
        self.tree.setdefault("images", []).append(
            {"bufferView": self._view(png(picture)), "mimeType": "image/png"}
        )
        self.tree.setdefault("textures", []).append({"source": len(self.tree["images"]) - 1})
        texture = {"index": len(self.tree["textures"]) - 1}
        surface = {"baseColorTexture": texture, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        self.tree["materials"] = [{"name": "map", "pbrMetallicRoughness": surface}]
        for mesh in self.tree["meshes"]:
            for primitive in mesh["primitives"]:
                primitive["material"] = 0

    def primitive(
        self,
        given: dict[str, Any],
        faces: IntArray,
        corners: IntArray,
        uv: npt.NDArray[np.float64],
        uv_set: str,
    ) -> dict[str, Any]:
        """A primitive of triangles whose vertices are copied along the seams, one uv each.

        Args:
            given: the primitive as it was.
            faces: (F, 3) its triangles.
            corners: (F, 3) rows of `uv`.
            uv: (T, 2) the new map; v runs upwards.
            uv_set: name of the attribute that holds it.
        """
        pairs = np.stack([faces, corners], axis=2).reshape(-1, 2)
        pairs, row = np.unique(pairs, axis=0, return_inverse=True)
        rows = pairs[:, 0]
        made = dict(given, mode=TRIANGLES)
        made["attributes"] = {
            name: self._gathered(index, rows) for name, index in given["attributes"].items()
        }
        if "targets" in given:
            made["targets"] = [
                {name: self._gathered(index, rows) for name, index in target.items()}
                for target in given["targets"]
            ]
        downwards = uv[pairs[:, 1]] * [1.0, -1.0] + [0.0, 1.0]
        made["attributes"][uv_set] = self._accessor(
            downwards.astype(np.float32), {"componentType": FLOAT, "type": "VEC2"}, VERTEX_BUFFER
        )
        made["indices"] = self._accessor(
            row.reshape(-1, 1).astype(np.uint32),
            {"componentType": WHOLE, "type": "SCALAR"},
            INDEX_BUFFER,
        )
        return made

    def _gathered(self, index: int, rows: IntArray) -> int:
        """An accessor of some rows of another."""
        about = {
            key: value
            for key, value in self.tree["accessors"][index].items()
            if key in {"componentType", "type", "normalized", "name", "extras", "min"}
        }
        return self._accessor(self.scene.stored(index)[rows], about, VERTEX_BUFFER)

    def _accessor(self, values: npt.NDArray[Any], about: dict[str, Any], target: int) -> int:
        """A new accessor of values (n, width); each row of vertices begins at four bytes."""
        item = about | {"count": len(values)}
        if "min" in item:
            item |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        size = values.dtype.itemsize * values.shape[1]
        stride = size if target == INDEX_BUFFER else -(-size // 4) * 4
        padded = np.zeros((len(values), stride), dtype=np.uint8)
        padded[:, :size] = np.ascontiguousarray(values).view(np.uint8).reshape(len(values), size)
        item["bufferView"] = self._view(padded.tobytes(), target, stride)
        self.tree.setdefault("accessors", []).append(item)
        return len(self.tree["accessors"]) - 1

    def _view(self, data: bytes, target: int | None = None, stride: int | None = None) -> int:
        """A new buffer view."""
        item: dict[str, Any] = {"buffer": 0, "byteLength": len(data)}
        if target is not None:
            item["target"] = target
        if target == VERTEX_BUFFER:
            item["byteStride"] = stride
        views = self.tree.setdefault("bufferViews", [])
        views.append(item)
        self.views[len(views) - 1] = data
        return len(views) - 1

    def file(self) -> bytes:
        """The GLB file, with what is in use alone, its pictures inside."""
        for index, image in enumerate(self.tree.get("images", [])):
            if not image.get("uri", "data:").startswith("data:"):
                data = self.scene.image(index)
                kind = KINDS.get(data[:4], "image/jpeg")
                del image["uri"]
                image |= {"bufferView": self._view(data), "mimeType": image.get("mimeType", kind)}
        _keep_used(self.tree, "accessors", list(_accessor_slots(self.tree)))
        slots = list(_view_slots(self.tree))
        contents = [self._content(index) for index in sorted({of[key] for of, key in slots})]
        _keep_used(self.tree, "bufferViews", slots)
        body = bytearray()
        for view, content in zip(self.tree.get("bufferViews", []), contents, strict=True):
            body += b"\0" * (-len(body) % 4)
            view |= {"buffer": 0, "byteOffset": len(body), "byteLength": len(content)}
            body += content
        body += b"\0" * (-len(body) % 4)
        self.tree["buffers"] = [{"byteLength": len(body)}]
        text = json.dumps(self.tree, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        return b"".join(
            [
                struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(body)),
                struct.pack("<I4s", len(text), b"JSON"),
                text,
                struct.pack("<I4s", len(body), b"BIN\0"),
                bytes(body),
            ]
        )

    def _content(self, index: int) -> bytes:
        """The bytes of a buffer view, new or old."""
        if index in self.views:
            return self.views[index]
        view = self.tree["bufferViews"][index]
        start = view.get("byteOffset", 0)
        return self.scene.buffer(view["buffer"])[start : start + view["byteLength"]]


Slot = tuple[Any, Any]
"""A dictionary or list of the JSON, and the key under which it holds a number."""


def _accessor_slots(tree: dict[str, Any]) -> Iterator[Slot]:
    """Where the JSON names accessors."""
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            for attributes in (primitive["attributes"], *primitive.get("targets", [])):
                yield from ((attributes, name) for name in attributes)
            if "indices" in primitive:
                yield primitive, "indices"
    for animation in tree.get("animations", []):
        for sampler in animation["samplers"]:
            yield from ((sampler, name) for name in ("input", "output"))
    for skin in tree.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin, "inverseBindMatrices"


def _view_slots(tree: dict[str, Any]) -> Iterator[Slot]:
    """Where the JSON names buffer views."""
    for item in tree.get("accessors", []):
        sparse = item.get("sparse", {})
        for of in (item, sparse.get("indices", {}), sparse.get("values", {})):
            if "bufferView" in of:
                yield of, "bufferView"
    for image in tree.get("images", []):
        if "bufferView" in image:
            yield image, "bufferView"


def _keep_used(tree: dict[str, Any], name: str, slots: list[Slot]) -> None:
    """Drop what no slot names from a list of the JSON, and count the others anew."""
    used = sorted({of[key] for of, key in slots})
    number = {old: new for new, old in enumerate(used)}
    for of, key in {(id(of), key): (of, key) for of, key in slots}.values():
        of[key] = number[of[key]]
    if used:
        tree[name] = [tree[name][old] for old in used]
