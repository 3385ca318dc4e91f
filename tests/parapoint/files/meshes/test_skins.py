"""Skinned glTF: a vertex goes where its joints take it, however many there are."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint.errors import InputError
from parapoint.files.reading import read_surface
from parapoint.surfaces.surface import FloatArray, Mesh

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
UP = [0, 0, 2]


def skinned(
    path: Path, weights: list[FloatArray], *, nodes: tuple[int, ...] = (0, 1, 2)
) -> FloatArray:
    """Vertices of a triangle whose joints, one above the other, have these weights."""
    arrays = {"POSITION": TRIANGLE.astype("<f4")}
    for k, weight in enumerate(weights):
        arrays[f"JOINTS_{k}"] = np.tile(np.arange(4, dtype=np.uint8) % 2, (3, 1))
        arrays[f"WEIGHTS_{k}"] = np.tile(weight, (3, 1)).astype("<f4")
    data = b"".join(array.tobytes() for array in arrays.values())
    places = np.cumsum([0, *(array.nbytes for array in arrays.values())]).tolist()
    views = [
        {"buffer": 0, "byteOffset": at, "byteLength": array.nbytes}
        for at, array in zip(places, arrays.values(), strict=False)
    ]
    accessors = [
        {
            "bufferView": k,
            "componentType": 5126 if array.dtype.kind == "f" else 5121,
            "count": 3,
            "type": f"VEC{array.shape[1]}",
        }
        for k, array in enumerate(arrays.values())
    ]
    path.with_suffix(".bin").write_bytes(data)
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": path.with_suffix(".bin").name, "byteLength": len(data)}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": {name: k for k, name in enumerate(arrays)}}]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"translation": UP}, {}],
        "skins": [{"joints": [1, 2]}],
        "scenes": [{"nodes": list(nodes)}],
    }
    path.write_text(json.dumps(tree))
    surface = read_surface(path)
    assert isinstance(surface, Mesh)
    return surface.vertices


@pytest.mark.parametrize(
    ("weights", "share"),
    [
        ([[1.0, 0, 0, 0]], 1),
        ([[0.25, 0.75, 0, 0]], 0.25),
        ([[0.25, 0, 0, 0], [0, 0.75, 0, 0]], 0.25),  # a joint in each of two sets
        ([[0.125, 0.125, 0.125, 0.125]] * 2, 0.5),
        ([[0.25, 0.25, 0, 0]], 0.5),  # a sum of 1/2
        ([[3.0, 1, 0, 0]], 0.75),
        ([[0.0, 0, 0, 0]], 1),  # no weight: the first joint has it
    ],
)
def test_weights_of_joints_sum_to_one(
    tmp_path: Path, weights: list[FloatArray], share: float
) -> None:
    """The share of the joint that is moved up."""
    assert_allclose(skinned(tmp_path / "a.gltf", weights), TRIANGLE + share * np.array(UP))


def test_joints_outside_the_scene_are_named(tmp_path: Path) -> None:
    """One line, not the number of a node alone."""
    with pytest.raises(InputError, match="has a skin whose joint 1 is not in the scene"):
        skinned(tmp_path / "a.gltf", [np.array([1.0, 0, 0, 0])], nodes=(0,))
