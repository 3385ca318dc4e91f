"""Maps that any tool has made: what fits becomes rows, all else is named and refused."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cases.builtin import BUILTIN
from benchmarks.cases.suites import Suite
from benchmarks.store import measuring, submissions
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.surface import Mesh

SUITE = Suite("trial", "A trial", ("cone", "saddle", "cone@uneven", "wavy_sheet"), ())


def obj(mesh: Mesh, uv=None, order=None) -> str:
    """An OBJ file as a tool prints it: six digits, a vt line for each vertex."""
    uv = mesh.vertices[:, :2] if uv is None else uv
    faces = mesh.faces if order is None else mesh.faces[order]
    lines = ["v {:.6f} {:.6f} {:.6f}".format(*point) for point in mesh.vertices]
    lines += ["vt {:.6f} {:.6f}".format(*point) for point in uv]
    lines += ["f {0}/{0} {1}/{1} {2}/{2}".format(*face) for face in faces + 1]
    return "\n".join(lines) + "\n"


@pytest.fixture
def maps(tmp_path):
    folder = tmp_path / "maps"
    folder.mkdir()
    for case in ("cone", "saddle"):
        (folder / f"{case}.obj").write_text(obj(BUILTIN[case]()))
    return folder


def add(store, submission):
    with store.writing():
        run = store.add_run({})
        for row in submissions.rows(store, submission, SUITE, run):
            store.append(row)
    return {row.case: row for row in store.rows()}


def test_maps_become_rows_and_missing_cases_are_named(maps, tmp_path):
    (maps / "notes.txt").write_text("nothing of it is read")
    found = submissions.read(maps, "  My   tool 2.0 ", SUITE)
    assert found.method == "My tool 2.0"
    assert [one.case for one in found.maps] == ["cone", "saddle"]
    assert found.missing == ["wavy_sheet"]
    assert found.clouds == ["cone@uneven"]
    rows = add(store := Store(tmp_path / "out"), found)
    assert rows["wavy_sheet"].status == "skipped"
    assert rows["wavy_sheet"].reason == "no map was submitted"
    row = rows["cone"]
    assert (row.method, row.params, row.seconds) == ("submitted", {"name": "My tool 2.0"}, None)
    assert (store.surface(row).vertices == BUILTIN["cone"]().vertices).all()  # the model's own
    values = measuring.metrics(store).set_index("case").loc["cone"]
    assert values["flipped_fraction"] == 0
    assert values["bijective"] == 1


def turned(mesh, matrix):
    return Mesh(mesh.vertices @ np.array(matrix, dtype=float).T, mesh.faces)


def relabelled(mesh):
    """Vertices in another order in the list, while the faces still name the old places."""
    return Mesh(np.random.default_rng(0).permutation(mesh.vertices), mesh.faces)


CONE = BUILTIN["cone"]()
COUNT = len(CONE.faces)
WRONG = {
    "mirrored": (obj(turned(CONE, np.diag([-1, 1, 1]))), "it is mirrored"),
    "mirrored by two axes in place of one": (
        obj(turned(CONE, [[0, 1, 0], [1, 0, 0], [0, 0, 1]])),
        "it is mirrored",
    ),
    "other axes, as Blender exports": (
        obj(turned(CONE, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])),
        "turned by other axes",
    ),
    "shuffled": (obj(relabelled(CONE)), "vertices are shuffled or moved"),
    "moved": (obj(turned(CONE, 1.001 * np.eye(3))), "vertices are shuffled or moved"),
    "faces in another order": (
        obj(CONE, order=np.arange(COUNT)[::-1]),
        "its faces are in another order",
    ),
    "corners in another order": (
        obj(Mesh(CONE.vertices, np.roll(CONE.faces, 1, axis=1))),
        "the corners of its faces are in another order",
    ),
    "other faces": (obj(BUILTIN["saddle"]()), f"and the model has {COUNT:,}"),
    "a face less": (obj(CONE, order=np.arange(COUNT - 1)), f"has {COUNT - 1:,} faces, and the"),
    "nan": (obj(CONE, uv=CONE.vertices[:, :2] * np.nan), "uv must be finite"),
    "one nan": (obj(CONE).replace("vt ", "vt nan ", 1), "cone.obj"),
    "infinite": (obj(CONE, uv=CONE.vertices[:, :2] + np.inf), "uv must be finite"),
    "no area": (obj(CONE, uv=CONE.vertices[:, :2] * [1, 0]), "all UVs lie on one line"),
    "no uv": (obj(CONE).replace("vt", "#"), "cone.obj"),
    "no mesh": ("hello\n", "cone.obj"),
    "empty": ("", "is empty"),
}


@pytest.mark.parametrize(("text", "said"), WRONG.values(), ids=WRONG.keys())
def test_a_wrong_file_is_named_and_all_is_refused(maps, text, said):
    (maps / "cone.obj").write_text(text)
    with pytest.raises(InputError, match=r"refused, nothing is written: .*cone\.obj") as error:
        submissions.read(maps, "tool", SUITE)
    assert said in str(error.value)


def test_every_wrong_file_is_named(maps):
    (maps / "cone.obj").write_text(WRONG["mirrored"][0])
    (maps / "saddle.obj").write_text("")
    (maps / "hand.obj").write_text(obj(CONE))
    with pytest.raises(InputError) as error:
        submissions.read(maps, "tool", SUITE)
    for name in ("cone.obj: ", "saddle.obj: ", "hand.obj: no case of trial"):
        assert name in str(error.value)


def test_a_folder_must_be_there_with_a_map_of_the_suite(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        submissions.read(tmp_path / "none", "tool", SUITE)
    with pytest.raises(InputError, match=r"has no map of trial; name its files .* cone\.obj"):
        submissions.read(tmp_path, "tool", SUITE)


@pytest.mark.parametrize("name", ["", "  ", "x" * 81, "a\x1b[31mb", "a\u202eb", "\ud800"])
def test_a_name_that_cannot_be_shown_is_refused(maps, name):
    with pytest.raises(InputError, match="a method is called by"):
        submissions.read(maps, name, SUITE)


@pytest.mark.parametrize(
    "name",
    ["../../x", "slim", "__import__('os')", "<script>", "{{ 7 * 7 }}", "a,b(c=1)", "'", "x" * 80],
)
def test_a_name_is_text_and_never_code_or_path(maps, tmp_path, name):
    before = set(tmp_path.parent.iterdir())
    store = Store(tmp_path / "out")
    rows = add(store, submissions.read(maps, name, SUITE))
    assert rows["cone"].params == {"name": name}
    assert set(tmp_path.parent.iterdir()) == before
    names = {path.name for path in (tmp_path / "out" / "uv").iterdir()}
    assert names == {f"{row.id}.npz" for row in rows.values() if row.status == "ok"}
