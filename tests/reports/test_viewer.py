import base64
import json
import zlib

import numpy as np
import pytest

from parapoint.parameterization import Parameterization
from reports import render, viewer
from reports.pictures import Map

from .conftest import ball, flat, sheet


def unpacked(given):
    """What the viewer makes of `packed`, read from its description: planes of bytes of steps."""
    content = np.frombuffer(zlib.decompress(base64.b64decode(given["data"])), np.uint8)
    planes = content.reshape(given["bytes"], given["columns"], given["rows"]).astype(np.uint64)
    steps = sum(plane << np.uint64(8 * at) for at, plane in enumerate(planes))
    size = np.uint64(2 ** (8 * given["bytes"]))
    return (np.cumsum(steps, axis=1, dtype=np.uint64) % size).T


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_packed_integers_come_back(kind):
    values = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (50, 3), kind, endpoint=True)
    np.testing.assert_array_equal(unpacked(viewer.packed(values)), values)
    assert unpacked(viewer.packed(values[:0])).shape == (0, 3)
    np.testing.assert_array_equal(unpacked(viewer.packed(values[:, 0]))[:, 0], values[:, 0])


def points(given):
    return np.array(given["low"]) + unpacked(given["steps"]) / 65535 * given["side"]


def test_a_shape_is_given_to_a_65535th_of_its_size():
    mesh = sheet()
    camera = render.camera(mesh, np.eye(3)[2], np.eye(3)[1])
    given = viewer.shape(mesh, camera)
    order = unpacked(given["order"])[:, 0].astype(int)
    assert sorted(order) == list(range(len(mesh.faces)))
    corners = points(given["vertices"])[unpacked(given["faces"]).astype(int)]
    np.testing.assert_allclose(corners, mesh.vertices[mesh.faces[order]], atol=0.5 / 65535)
    assert given["axes"] == camera.axes.tolist()


def data(mesh, result):
    found = Map(mesh, result)
    state = {"spanning": found.spanning, "flipped": found.flipped}
    heat = {"angle": (found.angle, 0.0, 2.0)}
    return found, viewer.uv_map(mesh, result, found.uv, distortion=heat, **state)


def test_a_map_that_is_not_cut_lists_no_corners():
    mesh = sheet()
    found, given = data(mesh, flat(mesh))
    assert given["moved"]["rows"] == 0
    assert given["seams"]["rows"] == 0
    assert given["border"]["rows"] == 4 * 8
    near, order = viewer.ordered(mesh)
    uv = points(given["uv"])[near.faces]
    np.testing.assert_allclose(uv, found.uv[order], atol=given["uv"]["side"] / 65535)


def test_a_cut_map_comes_back_with_its_seams():
    mesh = ball()
    # Every face on its own, mirrored in u: all edges are seams.
    uv = (
        mesh.vertices[mesh.faces][..., :2].reshape(-1, 2)
        + np.arange(len(mesh.faces)).repeat(3)[:, None]
    )
    found, given = data(mesh, Parameterization(uv, np.arange(len(uv)).reshape(-1, 3)))
    assert given["border"]["rows"] == 0
    assert given["seams"]["rows"] == 3 * len(mesh.faces)
    near, order = viewer.ordered(mesh)
    corners = near.faces.reshape(-1).copy()
    place, row = unpacked(given["moved"]).T.astype(int)
    corners[place] = row
    assert len(np.unique(corners)) == len(corners)
    again = points(given["uv"])[corners].reshape(-1, 3, 2)
    np.testing.assert_allclose(again, found.uv[order], atol=given["uv"]["side"] / 65535)


def test_levels_of_a_scale():
    given = viewer.levels(np.array([-1.0, 0.0, 1.0, 2.0, np.inf, np.nan]), 0.0, 2.0)
    assert given.tolist() == [0, 0, 31, 62, 62, 63]


def test_a_script_holds_one_object():
    text = viewer.script("a.js", {"x": [1, 2]})
    name, content = text.removeprefix("received[").rstrip(";\n").split("]=", 1)
    assert json.loads(name) == "a.js"
    assert json.loads(content) == {"x": [1, 2]}


def test_a_large_model_is_left_out_and_said(monkeypatch):
    monkeypatch.setattr(viewer, "LARGEST", 10)
    mesh = sheet()
    camera = render.camera(mesh, np.eye(3)[2], np.eye(3)[1])
    assert viewer.shape(mesh, camera) == {"large": 128}
    assert data(mesh, flat(mesh))[1] == {"large": 128}
