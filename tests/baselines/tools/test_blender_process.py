"""The script that Blender runs, with a module in Blender's place that keeps what it is told."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines.tools.blender import SCRIPT

BPY = '''
import json, sys, types
import numpy as np

print("Blender says hello, where answers are awaited")


class Told:
    """Keeps what it is told, in the order of the calls."""

    def __init__(self, name, log):
        self.name, self.log = name, log

    def add(self, count):
        self.log.append([self.name, "add", int(count)])

    def foreach_set(self, what, values):
        self.log.append([self.name, what, np.asarray(values).tolist(), str(values.dtype)])

    def foreach_get(self, what, values):
        corners = np.reshape(self.log[3][2], (-1))
        places = np.reshape(self.log[1][2], (-1, 3))
        values[:] = places[corners][:, :2].ravel()


class Mesh:
    def __init__(self, log):
        self.vertices, self.loops, self.polygons = (
            Told(name, log) for name in ("vertices", "loops", "polygons")
        )
        self.log, self.uv_layers = log, Layers()
        self.uv_layers["uv"] = types.SimpleNamespace(uv=Told("uv", log))

    def update(self, calc_edges):
        self.log.append(["update", calc_edges])

    def validate(self):
        faces = np.reshape(self.log[3][2], (-1, 3))
        return len(np.unique(np.sort(faces, axis=1), axis=0)) < len(faces)


class Layers(dict):
    def new(self, name):
        assert name == "uv"


log = []


def empty(use_empty):
    print("empty", use_empty)
    assert use_empty, "there is another mesh in the scene"


def unwrap(**options):
    log.append(["unwrap", options])
    with open(options["log"], "w") as file:
        json.dump(log, file)
    if options.get("fails"):
        raise RuntimeError("no way\\n to map it")
    return {"CANCELLED"} if options.get("cancels") else {"FINISHED"}


space = types.SimpleNamespace
app = space(version_string="9.9.9")
active = space(active=None)
context = space(
    collection=space(objects=space(link=lambda thing: log.append(["link", thing]))),
    view_layer=space(objects=active),
)
data = space(
    meshes=space(new=lambda name: Mesh(log)), objects=space(new=lambda name, mesh: "thing")
)
ops = space(
    wm=space(read_factory_settings=empty),
    object=space(mode_set=lambda mode: log.append(["mode", mode])),
    mesh=space(select_all=lambda action: log.append(["select", action])),
    uv=space(unwrap=unwrap),
)
'''

VERTICES = np.array([[0.0, 0, 5], [1, 0, 5], [1, 1, 5], [0, 1, 5]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])


def run(folder, task):
    """What the script answers, line by line, and the seconds that it took."""
    (folder / "bpy.py").write_text(BPY)
    begun = time.perf_counter()
    ended = subprocess.run(
        [sys.executable, str(SCRIPT)],
        input=task,
        env=os.environ | {"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    return [json.loads(line) for line in ended.stdout.splitlines()], time.perf_counter() - begun


def task(folder, faces=FACES, **options):
    np.savez(folder / "mesh.npz", vertices=VERTICES, faces=faces)
    files = {"source": str(folder / "mesh.npz"), "target": str(folder / "uv.npy")}
    options |= {"log": str(folder / "log.json")}
    return json.dumps({**files, "operator": "unwrap", "options": options}) + "\n"


def test_a_mesh_goes_in_and_a_uv_for_each_corner_comes_out(tmp_path):
    (hello, answer), took = run(tmp_path, task(tmp_path, method="X"))
    assert hello == {"blender": "9.9.9"}
    assert 0 <= answer["seconds"] < took
    uv = np.load(tmp_path / "uv.npy")
    assert_allclose(uv, VERTICES[FACES][:, :, :2])
    log = json.loads((tmp_path / "log.json").read_text())
    assert_array_equal(log[1][2], VERTICES.ravel())
    assert log[0] == ["vertices", "add", 4]
    assert log[2:6] == [
        ["loops", "add", 6],
        ["loops", "vertex_index", FACES.ravel().tolist(), "int32"],
        ["polygons", "add", 2],
        ["polygons", "loop_start", [0, 3], "int32"],
    ]
    told = [["update", True], ["link", "thing"], ["mode", "EDIT"], ["select", "SELECT"]]
    assert log[6:10] == told
    assert log[10][1]["method"] == "X"


@pytest.mark.parametrize(
    ("given", "answer"),
    [
        ({"cancels": True}, {"error": "unwrap ended with CANCELLED"}),
        ({"fails": True}, {"error": "no way to map it"}),
    ],
)
def test_what_goes_wrong_is_told_in_one_line(tmp_path, given, answer):
    (_, told), _ = run(tmp_path, task(tmp_path, **given))
    assert told == answer


def test_a_mesh_that_blender_would_change_is_not_for_it(tmp_path):
    (_, told), _ = run(tmp_path, task(tmp_path, faces=np.array([[0, 1, 2], [2, 0, 1]])))
    assert told["unsupported"].startswith("Blender takes no mesh with two faces on the same")


def test_without_a_task_it_ends(tmp_path):
    answers, _ = run(tmp_path, "")
    assert answers == [{"blender": "9.9.9"}]
