import json
import zlib

import numpy as np
import pytest

from benchmarks.rendering.camera import camera as camera_on
from benchmarks.rendering.maps import Map
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh
from reports.page import viewer

from ..conftest import ball, flat, sheet


def eights(text):
    """The bytes whose bits a text holds by sevens."""
    bits = "".join(f"{ord(letter):07b}" for letter in text)
    return bytes(int(bits[at : at + 8], 2) for at in range(0, len(bits) - 7, 8))


def read(text):
    """Name and object of a script, its arrays as its description says: planes of bytes."""
    name, content = text.removeprefix("received[").rstrip(";\n").split("]=", 1)
    given = json.loads(content, strict=False)  # with letters that JSON would have escaped
    planes = np.frombuffer(zlib.decompress(eights(given.pop("data"))), np.uint8)
    for key, (size, rows, columns) in given.pop("arrays").items():
        own, planes = np.split(planes, [size * rows * columns])
        items = own.reshape(size, columns, rows).astype(np.uint64)
        given[key] = sum(plane << np.uint64(8 * at) for at, plane in enumerate(items)).T.astype(int)
    assert len(planes) == 0
    return json.loads(name), given


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_a_script_holds_facts_and_arrays(kind):
    draw = np.random.default_rng(0)
    values = draw.integers(0, np.iinfo(kind).max, (500, 3), kind, endpoint=True)
    text = viewer.script(
        "a.js", {"x": 1}, {"some": values, "none": values[:0], "row": values[:, 0]}
    )
    assert text.isascii()
    assert text.count("\n") == 1
    assert "\r" not in text
    name, given = read(text)
    assert (name, given["x"]) == ("a.js", 1)
    np.testing.assert_array_equal(given["some"], values)
    np.testing.assert_array_equal(given["row"][:, 0], values[:, 0])
    assert given["none"].shape == (0, 3)


def test_letters_by_sevens_are_every_one_of_them():
    letters = bytes(range(128))
    bits = np.unpackbits(np.frombuffer(letters, np.uint8)).reshape(-1, 8)[:, 1:]
    inside = viewer.sevens(np.packbits(bits).tobytes())
    assert json.loads(f'"{inside}"', strict=False) == letters.decode()
    assert eights(json.loads(f'"{viewer.sevens(b"any")}"', strict=False)) == b"any"


def summed(steps):
    """Undoes `steps`."""
    return np.cumsum(np.where(steps % 2, -(steps + 1) // 2, steps // 2), axis=0)


def test_steps_are_small_and_undone():
    values = np.array([[3, 250], [1, 4]])
    steps = viewer.steps(values)
    assert steps.tolist() == [[6, 500], [3, 491]]
    np.testing.assert_array_equal(summed(steps.astype(int)), values)


def shares(one, two, three, new):
    """Of the corners of a triangle in `new`, turned into its plane about the edge one - two."""
    edge, (known, met) = two - one, (of - one for of in (three, new))
    if not edge.any():
        return 1, 1, -1
    along = [of @ edge / (edge @ edge) for of in (known, met)]
    high = [np.linalg.norm(of - t * edge) for of, t in zip((known, met), along, strict=True)]
    if high[0] == 0 or high[1] > viewer.STEEPEST * high[0]:
        return 1, 1, -1
    third = -high[1] / high[0]
    second = along[1] - third * along[0]
    return 1 - second - third, second, third


def places(surprises, corners, bits, space=None):
    """Undoes `surprises`, face by face as the viewer does."""
    found = np.zeros((corners.max() + 1, surprises.shape[1]), int)
    opposite, seen, before = {}, set(), None
    rest = iter(surprises)
    for face in corners.tolist():
        for k, row in enumerate(face):
            if row in seen:
                continue
            seen.add(row)
            one, two = face[(k + 1) % 3], face[(k + 2) % 3]
            three = opposite.get(frozenset((one, two)))
            if three is not None:
                known = (one, two, three)
                parts = (1, 1, -1) if space is None else shares(*space[[*known, row]])
                guess = np.floor(parts @ found[[*known]] + 0.5).astype(int)
            else:
                guess = 0 if before is None else found[before]
            wrong = next(rest)
            found[row] = (guess + np.where(wrong % 2, -(wrong + 1) // 2, wrong // 2)) % 2**bits
            before = row
        for k in range(3):
            opposite.setdefault(frozenset((face[k], face[(k + 1) % 3])), face[(k + 2) % 3])
    return found


def test_surprises_are_undone_and_small_on_a_plane():
    mesh, _, _ = viewer.ordered(sheet())
    x, y, _ = mesh.vertices.T
    box, flat_places = viewer.quantised(np.stack([x, y], axis=1), 14)
    assert box["bits"] == 14
    given = viewer.surprises(flat_places, mesh.faces, 14)
    np.testing.assert_array_equal(places(given, mesh.faces, 14), flat_places)
    assert np.quantile(given, 0.9) <= 6  # affine: nothing but rounding, and the first faces
    uneven = flat_places // 2 + np.random.default_rng(2).integers(0, 600, flat_places.shape)
    space = np.append(uneven, 0 * uneven[:, :1], axis=1)
    given = viewer.surprises(uneven, mesh.faces, 14, space)
    np.testing.assert_array_equal(places(given, mesh.faces, 14, space), uneven)
    assert np.quantile(given, 0.9) <= 6  # whatever the faces are like
    assert np.quantile(viewer.surprises(uneven, mesh.faces, 14), 0.5) > 200
    anywhere = np.random.default_rng(0).integers(0, 2**14, flat_places.shape)
    for space in (None, np.random.default_rng(1).integers(0, 2**16, (len(anywhere), 3))):
        given = viewer.surprises(anywhere, mesh.faces, 14, space)
        assert given.max() < 2**14
        np.testing.assert_array_equal(places(given, mesh.faces, 14, space), anywhere)


def shape(mesh):
    """What is read of a shape: all, and its faces."""
    camera = camera_on(mesh, np.eye(3)[2], np.eye(3)[1])
    sky = np.linspace(0, 1, 2 * len(mesh.vertices)).reshape(-1, 2)
    _, given = read(viewer.script("a.js", *viewer.shape(mesh, camera, sky)))
    assert given["axes"] == camera.axes.tolist()
    faces, highest, rest = [], 0, iter(given["faces"][:, 0])
    for code in given["places"][:, 0]:
        face = []
        for place in (code % 4, code // 4, 3):
            if place < 3:
                face.append(faces[-1][place])
            else:
                below = next(rest)
                face.append(highest - below)
                highest += below == 0
        faces.append(face)
    return given, np.array(faces), sky


def test_a_shape_is_given_to_a_65535th_of_its_size():
    mesh = sheet()
    # In pieces, one of them turned over, and with a vertex that no face has.
    mesh = Mesh(
        np.concatenate([[[9.0, 9, 9]], mesh.vertices, mesh.vertices + 2]),
        np.concatenate([mesh.faces + 1, mesh.faces[:, ::-1] + 1 + len(mesh.vertices)])[::-1],
    )
    given, faces, sky = shape(mesh)
    order = summed(given["order"][:, 0])
    corner = viewer.ordered(mesh)[1]
    np.testing.assert_array_equal(corner[:, 0] // 3, order)
    assert sorted(order) == list(range(len(mesh.faces)))
    box = given["box"]
    found = places(given["vertices"], faces, 16) / 65535 * box["side"] + box["low"]
    assert len(found) == len(mesh.vertices) - 1
    expected = mesh.vertices[mesh.faces.reshape(-1)[corner]]
    np.testing.assert_allclose(found[faces], expected, atol=box["side"] / 65535)
    light = places(given["sky"], faces, 8) / 255
    np.testing.assert_allclose(light[faces], sky[mesh.faces.reshape(-1)[corner]], atol=1 / 255)


def test_a_shape_is_seen_whole_by_its_camera():
    mesh = Mesh([[0, 0, 0], [3, 0, 0], [3, 4, 0], [3, 4, 12]], [[0, 1, 2], [0, 2, 3]])
    camera = camera_on(mesh, np.eye(3)[2], np.eye(3)[1])
    facts, _ = viewer.shape(mesh, camera, np.ones((4, 2)))
    assert facts["size"] == 13  # the diagonal of 3 by 4 by 12
    assert facts["centre"] == camera.centre.tolist()
    assert facts["half"] == camera.half.max() > camera.half.min()


def data(mesh, result):
    """A map, and what is read of it."""
    found = Map(mesh, result)
    state = {name: getattr(found, name) for name in ("spanning", "flipped", "covered")}
    heat = {"angle": (found.angle, 0.0, 2.0)}
    made = viewer.uv_map(mesh, result, found.uv, distortion=heat, **state)
    return found, read(viewer.script("a.js", *made))[1]


def drawn(mesh, given):
    """The old numbers of the corners, their rows and uv, and the levels of angles."""
    near, order, _ = viewer.ordered(mesh)
    corners = near.faces.reshape(-1).copy()
    place, row = summed(given["moved"]).T
    corners[place] = row
    corners, box = corners.reshape(-1, 3), given["box"]
    vertex = np.zeros(corners.max() + 1, int)
    vertex[corners] = near.faces
    space = viewer.quantised(near.vertices, 16)[1]
    found = places(given["uv"], corners, 14, space[vertex])
    rough = viewer.levels(viewer.rough(space[near.faces], found[corners], 1.0)["angle"], 0.0, 2.0)
    uv = found / 16383 * box["side"] + box["low"]
    return order, corners, uv[corners], (given["angle"][:, 0] + rough) % 256


def test_a_map_that_is_not_cut_lists_no_corners():
    mesh = sheet()
    found, given = data(mesh, flat(mesh))
    assert len(given["moved"]) == 0
    order, _, uv, angle = drawn(mesh, given)
    np.testing.assert_allclose(
        uv, found.uv.reshape(-1, 2)[order], atol=given["box"]["side"] / 16383
    )
    expected = viewer.levels(found.angle, 0.0, 2.0)[order[:, 0] // 3]
    np.testing.assert_array_equal(angle, expected)
    assert (given["angle"] == 0).mean() > 0.95


def test_a_face_begins_with_the_edge_that_it_shares_with_the_one_before():
    mesh = sheet()
    found, _, _ = viewer.ordered(mesh)
    before, here = found.faces[:-1], found.faces[1:]
    shared = (here[:, :, None] == before[:, None]).any(axis=2)
    neighbours = shared.sum(axis=1) == 2
    assert neighbours.mean() > 0.5
    assert shared[neighbours, :2].all()


def test_a_cut_map_comes_back_with_its_seams():
    mesh = ball()
    # Every face on its own, mirrored in u: all edges are seams.
    uv = (
        mesh.vertices[mesh.faces][..., :2].reshape(-1, 2)
        + np.arange(len(mesh.faces)).repeat(3)[:, None]
    )
    found, given = data(mesh, Parameterization(uv, np.arange(len(uv)).reshape(-1, 3)))
    order, corners, again, _ = drawn(mesh, given)
    assert len(np.unique(corners)) == corners.size
    np.testing.assert_allclose(
        again, found.uv.reshape(-1, 2)[order], atol=given["box"]["side"] / 16383
    )


def test_faces_that_a_map_leaves_out_do_not_move_the_others():
    mesh = sheet()
    uv = flat(mesh).uv
    region = Parameterization(np.where(uv[:, :1] > 0.5, np.nan, uv), mesh.faces)
    found, given = data(mesh, region)
    order, _, again, angle = drawn(mesh, given)
    kept = found.covered[order[:, 0] // 3]
    assert 0 < kept.sum() < len(kept)
    np.testing.assert_allclose(
        again, found.uv.reshape(-1, 2)[order], atol=given["box"]["side"] / 16383
    )
    np.testing.assert_array_equal(given["state"][:, 0], np.where(kept, 0, viewer.LEFT_OUT))
    expected = viewer.levels(found.angle, 0.0, 2.0)[order[:, 0] // 3]
    np.testing.assert_array_equal(angle[kept], expected[kept])
    assert (given["angle"][~kept, 0] == 0).all()  # not defined, here and in the page


def test_rough_distortion_of_a_stretch_known_by_hand():
    space = np.array([[[0, 0, 0], [100, 0, 0], [0, 100, 0]], [[0, 0, 0], [0, 0, 0], [1, 1, 1]]])
    places = np.array([[[9, 9], [209, 9], [9, 59]], [[0, 0], [1, 0], [0, 1]]])
    found = viewer.rough(space, places, 2.0)
    np.testing.assert_allclose(found["angle"], [2.0, np.nan])
    np.testing.assert_allclose(found["area"], [2.0, np.nan])


def test_levels_of_a_scale():
    given = viewer.levels(np.array([-1.0, 0.0, 1.0, 2.0, np.inf, np.nan]), 0.0, 2.0)
    assert given.tolist() == [0, 0, 15, 30, 30, 31]


def test_a_large_model_is_left_out_and_said(monkeypatch):
    mesh = sheet()
    camera = camera_on(mesh, np.eye(3)[2], np.eye(3)[1])
    monkeypatch.setattr(viewer, "LARGEST", 128)
    assert "box" in viewer.shape(mesh, camera, np.ones((81, 2)))[0]
    assert "box" in data(mesh, flat(mesh))[1]
    monkeypatch.setattr(viewer, "LARGEST", 127)
    assert viewer.shape(mesh, camera, np.ones((81, 2))) == ({"large": 128}, {})
    assert data(mesh, flat(mesh))[1] == {"large": 128}
