"""glTF 2, as .gltf and .glb: bytes in, `Content` out.

Ours, since trimesh drops the UV of primitives that have no material.
"""

from __future__ import annotations

import base64
import json
import logging
import struct
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from parapoint.errors import InputError
from parapoint.files.attributes import srgb
from parapoint.files.content import (
    NO_UV,
    Content,
    points_content,
    welded,
    whole,
)
from parapoint.files.decoding import check_decoded, plain
from parapoint.files.meshes.gltf_primitives import draws_points, draws_triangles, mode_triangles
from parapoint.files.meshes.pictures import named_file
from parapoint.surfaces.surface import FloatArray, IntArray

GLTF_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
GLTF_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
UNDERSTOOD = {"KHR_mesh_quantization", "KHR_texture_transform", "EXT_mesh_gpu_instancing"}
"""Extensions that are read where a file requires them."""
APPEARANCE = (
    "KHR_materials_",
    "KHR_lights_",
    "KHR_texture_basisu",
    "EXT_texture_",
    "MSFT_texture_dds",
    "KHR_xmp",
)
"""How names of extensions begin that change no vertex and no UV."""
SPECULAR = "KHR_materials_pbrSpecularGlossiness"
"""The extension of materials that has a base colour of its own."""

logger = logging.getLogger("parapoint")


def gltf(data: bytes, folder: Path) -> Content:
    """The triangles (or, without any, the points) of a glTF 2 scene, moved to their places.

    glTF splits a vertex wherever a normal or a UV differs, so vertices are welded where their
    positions are exactly equal: seams of the UV are seams, not boundaries of the mesh. The UV are
    those of the first set, with v upwards as in OBJ.
    """
    return _scene(data, folder).content()


def opened(path: Path) -> Gltf:
    """The scene in a .glb or .gltf file.

    Raises:
        InputError, ValueError, KeyError, IndexError, struct.error, TypeError: it is no such file.
    """
    return _scene(plain(path.read_bytes()), path.parent)


def _scene(data: bytes, folder: Path) -> Gltf:
    """The scene in a text, or in binary glTF: a header and two chunks, JSON and data."""
    if not data.startswith(b"glTF"):
        return Gltf(json.loads(data), folder, b"", len(data))
    version = struct.unpack_from("<I", data, 4)[0]
    if version != 2:
        raise InputError(f"is binary glTF {version}; glTF 2 is read: convert it, or export it anew")
    length, kind = struct.unpack_from("<I4s", data, 12)
    if kind != b"JSON":
        raise InputError("has no JSON chunk")
    tail = data[20 + length :]
    chunk = b""
    if len(tail) >= 8:
        size, _ = struct.unpack_from("<I4s", tail)
        chunk = tail[8 : 8 + size]
    return Gltf(json.loads(data[20 : 20 + length]), folder, chunk, len(data))


class Placed(NamedTuple):
    """A primitive where a node of the scene puts it.

    Attributes:
        primitive: as the file has it.
        transform: (4, 4) of the node.
        weights: of its morph targets.
        skin: number of the skin whose joints move its vertices, or None.
        node: the node; None in a file without any.
    """

    primitive: dict[str, Any]
    transform: FloatArray
    weights: list[float]
    skin: int | None
    node: dict[str, Any] | None = None


class Gltf:
    """One glTF file while it is read.

    Attributes:
        tree: its JSON.
    """

    def __init__(self, tree: Any, folder: Path, chunk: bytes, size: int) -> None:
        if not isinstance(tree, dict):
            raise InputError("has no mesh")
        version = str(tree.get("asset", {}).get("version", 2))
        if version.partition(".")[0] != "2":
            raise InputError(f"is glTF {version}; glTF 2 is read: convert it, or export it anew")
        if not tree.get("meshes"):
            raise InputError("has no mesh")
        unknown = [
            name
            for name in tree.get("extensionsRequired", [])
            if name not in UNDERSTOOD and not name.startswith(APPEARANCE)
        ]
        if unknown:
            raise InputError(f"needs {unknown[0]}, which is not read; export it without")
        self.tree, self.folder, self.chunk, self.size = tree, folder, chunk, size
        self.buffers: dict[str | int, bytes] = {}
        self.world: dict[int, FloatArray] = {}  # (4, 4) transform of each node in the scene

    def buffer(self, index: int) -> bytes:
        """The bytes of a buffer, read once: the file's own chunk, in the text, or a file beside."""
        uri = self.tree["buffers"][index].get("uri")
        key = index if uri is None else uri
        if key not in self.buffers:
            self.buffers[key] = self._loaded(index, uri)
        return self.buffers[key]

    def _loaded(self, index: int, uri: str | None) -> bytes:
        if uri is None:
            if index or not self.chunk:  # a place holder for what an extension decodes
                raise InputError("has a buffer without data; export it uncompressed")
            return self.chunk
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        data = self._beside(uri).read_bytes()
        self.size += len(data)
        return data

    def _beside(self, uri: str) -> Path:
        """The file that the scene names, in the folder of the scene or below; as `named_file`.

        Files elsewhere are not read, so that a file of unknown origin shows no other ones.
        """
        short = unquote(uri).replace("\\", "/").rpartition("/")[2]
        found = [named_file(self.folder, name) for name in (unquote(uri), uri, short)]
        for path in found:
            if path is not None and path.resolve().is_relative_to(self.folder.resolve()):
                return path
        fault = "lies outside of its folder" if any(found) else "is not found"
        raise InputError(f"names {uri[:80]!r}, which {fault}; put {short[:80]!r} beside it")

    def image(self, index: int) -> bytes:
        """The bytes of an image file: a piece of a buffer, in the text, or a file beside."""
        item = self.tree["images"][index]
        if "bufferView" in item:
            view = self.tree["bufferViews"][item["bufferView"]]
            start = view.get("byteOffset", 0)
            return self.buffer(view["buffer"])[start : start + view["byteLength"]]
        return self._loaded(1, item["uri"])

    def image_name(self, index: int) -> str:
        """What messages call an image: its name, its file or its number."""
        item = self.tree["images"][index]
        file = item.get("uri", "data:")
        return str(item.get("name") or (f"image {index}" if file.startswith("data:") else file))

    def files(self) -> list[Path]:
        """The files beside it that hold its buffers and pictures, as far as they are there."""
        found = []
        for item in (*self.tree.get("buffers", []), *self.tree.get("images", [])):
            uri = str(item.get("uri", "data:"))
            if not uri.startswith("data:"):
                with suppress(InputError):
                    found.append(self._beside(uri))
        return found

    def triangles(self, primitive: dict[str, Any]) -> IntArray:
        """(F, 3) rows of the vertices of a primitive of mode 4, 5 or 6."""
        if "indices" in primitive:
            run = whole(self.accessor(primitive["indices"])).reshape(-1)
        else:
            run = np.arange(self.tree["accessors"][primitive["attributes"]["POSITION"]]["count"])
        return mode_triangles(primitive.get("mode", 4), run)

    def accessor(self, index: int) -> FloatArray | IntArray:
        """(n, width) values; normalized whole numbers become fractions."""
        array = self.stored(index)
        if array.dtype.kind == "f":
            return array.astype(np.float64)
        if self.tree["accessors"][index].get("normalized"):
            return np.maximum(array / float(np.iinfo(array.dtype).max), -1.0)
        return array.astype(np.int64)

    def stored(self, index: int) -> npt.NDArray[Any]:
        """(n, width) values of an accessor as they are stored."""
        item = self.tree["accessors"][index]
        width = GLTF_WIDTHS[item["type"]]
        if item["count"] < 1:
            raise InputError("has an accessor of impossible size")
        if "bufferView" in item:
            array = self._view(item, item["componentType"], item["count"], width)
        elif "sparse" not in item:
            raise InputError("has compressed data, which is not read; export it plain")
        else:  # zeros, of which some are replaced
            check_decoded(8 * width * item["count"], self.size)
            array = np.zeros((item["count"], width), GLTF_TYPES[item["componentType"]])
        if sparse := item.get("sparse"):
            indices, values = sparse["indices"], sparse["values"]
            rows = self._view(indices, indices["componentType"], sparse["count"], 1)[:, 0]
            if rows.max() >= len(array):
                raise InputError("has a sparse accessor with an index out of range")
            array = array.copy()
            array[rows] = self._view(values, item["componentType"], sparse["count"], width)
        return array

    def _view(
        self, item: dict[str, Any], component: int, count: int, width: int
    ) -> npt.NDArray[Any]:
        """(count, width) values as they lie in a buffer view, from the byte that `item` says."""
        view = self.tree["bufferViews"][item["bufferView"]]
        kind = np.dtype(GLTF_TYPES[component])
        stride = view.get("byteStride", width * kind.itemsize)
        start = view.get("byteOffset", 0) + item.get("byteOffset", 0)
        raw = self.buffer(view["buffer"])
        if count < 1 or start < 0 or stride < width * kind.itemsize:
            raise InputError("has an accessor of impossible size")
        if start + (count - 1) * stride + width * kind.itemsize > len(raw):
            raise InputError("ends early, in a buffer")
        return np.ndarray((count, width), kind, raw, start, (stride, kind.itemsize))

    def placed_primitives(self) -> list[Placed]:
        """The primitives of the scene, in order."""
        nodes = self.tree.get("nodes", [])
        if not nodes:
            return [
                Placed(primitive, np.eye(4), mesh.get("weights", []), None)
                for mesh in self.tree["meshes"]
                for primitive in mesh["primitives"]
            ]
        scenes = self.tree.get("scenes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        roots = (
            scenes[self.tree.get("scene", 0)].get("nodes", [])
            if scenes
            else [index for index in range(len(nodes)) if index not in children]
        )
        placed: list[Placed] = []
        waiting = [(index, np.eye(4)) for index in reversed(roots)]
        visited: set[int] = set()  # nodes form trees; a file in which they do not must not hang
        while waiting:
            index, outer = waiting.pop()
            if index in visited:
                raise InputError("has a node that hangs in two places")
            visited.add(index)
            node = nodes[index]
            transform = self.world[index] = outer @ _node_transform(node)
            if "mesh" in node:
                mesh = self.tree["meshes"][node["mesh"]]
                primitives = mesh["primitives"]
                weights = node.get("weights", mesh.get("weights", []))
                places = [transform @ local for local in self._instances(node)]
                check_decoded(128 * (len(placed) + len(places) * len(primitives)), self.size)
                placed += [
                    Placed(primitive, place, weights, node.get("skin"), node)
                    for place in places
                    for primitive in primitives
                ]
            waiting += [(child, transform) for child in reversed(node.get("children", []))]
        return placed

    def _instances(self, node: dict[str, Any]) -> list[FloatArray]:
        """(4, 4) transforms of the copies of a node's mesh (EXT_mesh_gpu_instancing), or one."""
        extension = node.get("extensions", {}).get("EXT_mesh_gpu_instancing")
        if extension is None:
            return [np.eye(4)]
        names = {"TRANSLATION": "translation", "ROTATION": "rotation", "SCALE": "scale"}
        given = {
            names[name]: self.accessor(index)
            for name, index in extension["attributes"].items()
            if name in names
        }
        if len({len(values) for values in given.values()}) != 1:
            raise InputError("has instances without a number of their own")
        rows = zip(*given.values(), strict=True)
        return [_node_transform(dict(zip(given, row, strict=True))) for row in rows]

    def _positions(self, placed: Placed) -> FloatArray:
        """(n, 3) the vertices of a primitive as the file poses them: morphed, skinned, in place."""
        attributes, transform = placed.primitive["attributes"], placed.transform
        local = np.asarray(self.accessor(attributes["POSITION"]), dtype=np.float64)
        targets = placed.primitive.get("targets", [])
        for share, target in zip(placed.weights, targets, strict=False):
            if share and "POSITION" in target:
                local = local + share * self.accessor(target["POSITION"])
        if not np.isfinite(local).all():
            raise InputError("has a position that is not finite")
        if placed.skin is None or "JOINTS_0" not in attributes:
            return np.asarray(local @ transform[:3, :3].T + transform[:3, 3])
        skin = self.tree["skins"][placed.skin]  # its joints move the vertices, and not the node
        if outside := [joint for joint in skin["joints"] if joint not in self.world]:
            raise InputError(f"has a skin whose joint {outside[0]} is not in the scene")
        joints = np.stack([self.world[joint] for joint in skin["joints"]])
        if "inverseBindMatrices" in skin:
            bound = self.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4)
            joints = joints @ bound.transpose(0, 2, 1)
        sets = range(sum(name.startswith("JOINTS_") for name in attributes))  # of four joints each
        joint = np.concatenate([self.accessor(attributes[f"JOINTS_{k}"]) for k in sets], axis=1)
        weight = np.concatenate([self.accessor(attributes[f"WEIGHTS_{k}"]) for k in sets], axis=1)
        total = weight.sum(axis=1, keepdims=True)
        # Viewers let weights sum to 1, and give a vertex without any to its first joint.
        weight = np.divide(
            weight, total, out=np.eye(1, weight.shape[1]) + 0 * weight, where=total > 0
        )
        blended = np.einsum("nj,njkl->nkl", weight, joints[whole(joint)])
        moved = np.einsum("nkl,nl->nk", blended[:, :3, :3], local) + blended[:, :3, 3]
        return np.asarray(moved, dtype=np.float64)

    def _texture(self, primitive: dict[str, Any]) -> tuple[str, FloatArray]:
        """The UV set of a primitive's base colour, and its (2, 3) transform."""
        index = primitive.get("material")
        material = {} if index is None else self.tree["materials"][index]
        named = ("normalTexture", "occlusionTexture", "emissiveTexture")
        textures: list[Any] = [base_colour(material)[1]]
        textures += [material.get(name) for name in named]
        texture: dict[str, Any] = next((item for item in textures if item), {})
        moved = texture.get("extensions", {}).get("KHR_texture_transform", {})
        name = f"TEXCOORD_{moved.get('texCoord', texture.get('texCoord', 0))}"
        if name not in primitive["attributes"]:
            name = "TEXCOORD_0"
        (x, y), (width, height) = moved.get("offset", (0, 0)), moved.get("scale", (1, 1))
        sine, cosine = np.sin(moved.get("rotation", 0)), np.cos(moved.get("rotation", 0))
        return name, np.array(
            [[width * cosine, height * sine, x], [-width * sine, height * cosine, y]]
        )

    def content(self) -> Content:
        """The scene as one content."""
        positions, colours, corners, uvs, uv_corners = [], [], [], [], []
        vertex_count = uv_count = decoded = 0
        placed_primitives = self.placed_primitives()
        if not any(draws_triangles(placed.primitive) for placed in placed_primitives):
            return self._points(placed_primitives)
        read = _told(placed_primitives, draws_triangles)
        for placed in read:
            primitive, transform = placed.primitive, placed.transform
            attributes = primitive["attributes"]
            place = self._positions(placed)
            turned = self.triangles(primitive)
            if np.linalg.det(transform[:3, :3]) < 0:  # a mirror image turns the faces round
                turned = turned[:, ::-1]
            triangles = turned.reshape(-1)
            decoded += place.nbytes + triangles.nbytes
            check_decoded(4 * decoded, self.size)
            if len(triangles) and (triangles.min() < 0 or triangles.max() >= len(place)):
                raise InputError(f"a vertex index is out of range (0 to {len(place) - 1})")
            positions.append(place)
            colours.append(self._colours(primitive, len(place)))
            corners.append(triangles + vertex_count)
            vertex_count += len(place)
            uv_set, uv_transform = self._texture(primitive)
            if uv_set in attributes:
                given = np.asarray(self.accessor(attributes[uv_set]), dtype=np.float64)
                uv = given @ uv_transform[:, :2].T + uv_transform[:, 2]
                if len(uv) != len(place):
                    raise InputError(f"{len(uv)} UV for {len(place)} vertices")
                uvs.append(np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1))
                uv_corners.append(triangles + uv_count)
                uv_count += len(uv)
            else:
                uv_corners.append(np.full(len(triangles), NO_UV))
        attributes = _vertex_colours(read, colours)
        # Vertices at one place are one if they have one colour, too.
        vertices, row = welded(np.column_stack([np.concatenate(positions), *attributes.values()]))
        flat = np.concatenate(corners)
        content = Content(vertices[:, :3], np.full(len(flat) // 3, 3), row[flat])
        if attributes:
            content.attributes["colours"] = vertices[:, 3:].astype(np.float32)
        if uvs:
            content.uv, content.uv_corners = np.concatenate(uvs), np.concatenate(uv_corners)
        content.extras = self._extras(read)
        return content

    def _extras(self, read: list[Placed]) -> tuple[str, ...]:
        """What no mesh holds of the scene, in words."""
        named = {"NORMAL": "normals", "TANGENT": "tangents", "JOINTS_0": "skins"}
        held = {name for placed in read for name in placed.primitive["attributes"]}
        of_vertices = held - {"POSITION", "COLOR_0", "TEXCOORD_0", "WEIGHTS_0"}
        return (
            *(named.get(name, name) for name in sorted(of_vertices)),
            *(["morph targets"] if any("targets" in one.primitive for one in read) else []),
            *(["objects"] if len(read) > 1 else []),
            *(name for name in ("materials", "animations", "cameras") if self.tree.get(name)),
        )

    def _points(self, placed_primitives: list[Placed]) -> Content:
        """The points of a scene without triangles, with their colours if some have any."""
        points, colours, decoded = [], [], 0
        read = _told(placed_primitives, draws_points)
        for placed in read:
            primitive = placed.primitive
            place = self._positions(placed)
            rows = np.arange(len(place))
            if "indices" in primitive:
                rows = whole(self.accessor(primitive["indices"])).reshape(-1)
                if rows.min() < 0 or rows.max() >= len(place):
                    raise InputError(f"a vertex index is out of range (0 to {len(place) - 1})")
            colour = self._colours(primitive, len(place))
            decoded += place.nbytes + rows.nbytes
            check_decoded(4 * decoded, self.size)
            points.append(place[rows])
            colours.append(colour[rows])
        if not points:
            raise InputError("has no triangle and no point")
        attributes = _vertex_colours(read, colours)
        return points_content(np.concatenate(points), attributes=attributes)

    def _colours(self, primitive: dict[str, Any], count: int) -> npt.NDArray[np.float32]:
        """(count, 4) sRGB of vertices: the material's colour times theirs, both linear in glTF."""
        number = primitive.get("material")
        material = {} if number is None else self.tree["materials"][number]
        colours = np.ones((count, 4))
        colours *= base_colour(material)[0]
        if (index := primitive["attributes"].get("COLOR_0")) is not None:
            given = self.stored(index)
            if len(given) != count:
                raise InputError(f"has {len(given)} colours for {count} vertices")
            most = 1.0 if given.dtype.kind == "f" else float(np.iinfo(given.dtype).max)
            colours[:, : given.shape[1]] *= given / most
        colours = np.clip(np.nan_to_num(colours), 0, 1)
        colours[:, :3] = srgb(colours[:, :3])
        return colours.astype(np.float32)


def base_colour(material: dict[str, Any]) -> tuple[list[float], dict[str, Any]]:
    """The base colour of a material: a linear RGBA factor, and the texture; {} without one."""
    if (diffuse := material.get("extensions", {}).get(SPECULAR)) is not None:
        return diffuse.get("diffuseFactor", [1.0] * 4), diffuse.get("diffuseTexture", {})
    base = material.get("pbrMetallicRoughness", {})
    return base.get("baseColorFactor", [1.0] * 4), base.get("baseColorTexture", {})


def image_of(texture: dict[str, Any]) -> int | None:
    """The image of a texture, or else that of an extension, as WebP and KTX 2 have one."""
    given = [texture, *texture.get("extensions", {}).values()]
    return next((int(of["source"]) for of in given if "source" in of), None)


def _vertex_colours(
    placed: list[Placed], colours: list[npt.NDArray[np.float32]]
) -> dict[str, npt.NDArray[np.float32]]:
    """The (count, 4) colours of each primitive as one attribute, if any gives its vertices some."""
    if not any("COLOR_0" in one.primitive["attributes"] for one in placed):
        return {}
    parts = np.concatenate(colours)
    return {"colours": parts if (parts[:, 3] < 1).any() else parts[:, :3]}


def _told(placed: list[Placed], is_read: Callable[[dict[str, Any]], bool]) -> list[Placed]:
    """The primitives that are read; a warning counts the others."""
    read = [one for one in placed if is_read(one.primitive)]
    others = [one.primitive for one in placed if not is_read(one.primitive)]
    if others:
        bare = sum("POSITION" not in primitive["attributes"] for primitive in others)
        logger.warning(
            "%d of %d primitives are not mapped: %d without POSITION, %d of points or lines",
            len(others),
            len(placed),
            bare,
            len(others) - bare,
        )
    return read


def _node_transform(node: dict[str, Any]) -> FloatArray:
    """(4, 4) transform of a glTF node: its matrix, or translation, rotation and scale."""
    if "matrix" in node:
        matrix = np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
        if not np.isfinite(matrix).all():
            raise InputError("has a transform that is not finite")
        return matrix
    turn = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=np.float64)
    stretch = np.array(node.get("scale", (1, 1, 1)), dtype=np.float64)
    transform = np.eye(4)
    shift = np.array(node.get("translation", (0, 0, 0)), dtype=np.float64)
    if not np.isfinite(np.concatenate([turn, stretch, shift])).all():
        raise InputError("has a transform that is not finite")
    transform[:3, :3] = Rotation.from_quat(turn).as_matrix() * stretch
    transform[:3, 3] = shift
    return transform
