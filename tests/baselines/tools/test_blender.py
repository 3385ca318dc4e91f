"""Blender's methods by a stand-in for bpy, and with Blender where PARAPOINT_BLENDER names it."""

import importlib.util
import json
import os
import stat
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines import registry
from baselines.tools import blender
from parapoint.errors import InputError
from parapoint.method import MissingError, UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.frame import in_unit
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere

DISK_METHODS = ("blender_angle_based", "blender_conformal", "blender_minimum_stretch")
METHODS = (*DISK_METHODS, "blender_smart_project")

# Answers as blender_process.py does; what it makes of a task is for each test to say.
STAND_IN = """
import json, os, sys
import numpy as np
print(json.dumps({{"blender": "5.0.1"}}), flush=True)
line = sys.stdin.readline()
if line:
    task = json.loads(line)
    mesh = np.load(task["source"])
    corners = mesh["vertices"][mesh["faces"]][:, :, :2].astype(np.float32)
    {body}
    np.save(task["target"], corners)
    print(json.dumps({{"seconds": 0.25}}), flush=True)
"""


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Makes an interpreter that answers in Blender's place."""

    def make(text):
        script = tmp_path / "answers.py"
        script.write_text(text)
        interpreter = tmp_path / "python"
        interpreter.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{script}"\n')
        interpreter.chmod(interpreter.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv(blender.INTERPRETER, str(interpreter))

    return make


def mapped(spec, mesh):
    return registry.method(spec)[1].parameterize(mesh, seed=0)


def test_maps_and_report_come_back(stand_in):
    stand_in(STAND_IN.format(body="pass"))
    mesh = irregular_disk()
    result = mapped("blender_conformal", mesh)
    assert result.report == {"blender": "5.0.1", "operator_seconds": 0.25}
    assert_array_equal(result.corners, mesh.faces)
    flat = Mesh(mesh.vertices * [1, 1, 0], mesh.faces)
    scale = np.sqrt(mesh.face_areas.sum() / flat.face_areas.sum())
    assert_allclose(result.uv, mesh.vertices[:, :2] * scale, rtol=1e-6)  # float32
    # An atlas stays as it is, corners apart where their uv are.
    stand_in(STAND_IN.format(body="corners[0] += 5"))
    result = mapped("blender_smart_project", mesh)
    assert_array_equal(np.unique(result.charts()), [0, 1])
    # Blender is given the surface around the origin; rtol for float32.
    given = in_unit(mesh.vertices, mesh.faces)[mesh.faces[0], :2]
    assert_allclose(result.uv[result.corners[0]], given + 5, rtol=1e-5)


@pytest.mark.parametrize(
    ("spec", "operator", "options"),
    [
        ("blender_angle_based", "unwrap", {"method": "ANGLE_BASED", "fill_holes": False}),
        (
            "blender_conformal(fill_holes=True)",
            "unwrap",
            {"method": "CONFORMAL", "fill_holes": True},
        ),
        (
            "blender_minimum_stretch(iterations=3)",
            "unwrap",
            {"method": "MINIMUM_STRETCH", "iterations": 3, "no_flip": False, "fill_holes": False},
        ),
        (
            "blender_smart_project(angle_limit=90)",
            "smart_project",
            {"angle_limit": np.pi / 2, "island_margin": 0.0, "area_weight": 0.0},
        ),
    ],
)
def test_options_reach_the_operator(stand_in, spec, operator, options):
    stand_in(STAND_IN.format(body="raise SystemExit(print(json.dumps({'error': line})))"))
    with pytest.raises(FlatteningError) as caught:
        mapped(spec, irregular_disk())
    task = json.loads(str(caught.value))
    assert (task["operator"], task["options"]) == (operator, options)


def test_process_is_started_before_the_clock_and_used_once(stand_in):
    stand_in(STAND_IN.format(body="pass"))
    method = registry.method("blender_angle_based")[1]
    method.preload()
    (waiting,) = blender._waiting
    assert waiting.process.poll() is None
    method.parameterize(irregular_disk(), seed=0)
    assert waiting.process.poll() == 0
    assert not blender._waiting


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (STAND_IN.format(body="raise SystemExit(print(json.dumps({'error': 'no'})))"), "^no$"),
        (STAND_IN.format(body="os.abort()"), "Blender ended, status -?[0-9]+"),
    ],
)
def test_failure_of_blender_is_one_of_the_method(stand_in, text, fault):
    stand_in(text)
    with pytest.raises(FlatteningError, match=fault):
        mapped("blender_smart_project", irregular_disk())


def test_mesh_that_blender_does_not_take_is_skipped(stand_in):
    stand_in(STAND_IN.format(body="raise SystemExit(print(json.dumps({'unsupported': 'two'})))"))
    with pytest.raises(UnsupportedError, match="two"):
        mapped("blender_smart_project", irregular_disk())


@pytest.mark.parametrize("name", METHODS)
def test_without_blender_it_is_said_how_to_get_it(name, monkeypatch):
    method = registry.method(name)[1]
    monkeypatch.delenv(blender.INTERPRETER, raising=False)
    if importlib.util.find_spec("bpy") is None:
        with pytest.raises(MissingError, match="benchmarks run installs it in an environment"):
            method.preload()
    monkeypatch.setenv(blender.INTERPRETER, "/nowhere/python")
    with pytest.raises(MissingError, match="there is no program /nowhere/python"):
        method.parameterize(irregular_disk(), seed=0)


@pytest.mark.parametrize("name", METHODS)
def test_a_run_installs_blender_where_no_interpreter_is_named(name):
    needed = () if os.environ.get(blender.INTERPRETER) else ("bpy>=4.3",)
    assert registry.describe(name).environment == needed


def test_interpreter_without_bpy_says_so(monkeypatch):
    monkeypatch.setenv(blender.INTERPRETER, sys.executable)
    with pytest.raises(MissingError, match=r"cannot import bpy \(No module named 'bpy'\)"):
        blender.started()


def test_no_iterations_are_refused():
    with pytest.raises(InputError, match="iterations must be at least 1"):
        registry.method("blender_minimum_stretch(iterations=0)")


@pytest.mark.skipif(not os.environ.get(blender.INTERPRETER), reason="PARAPOINT_BLENDER is not set")
def test_blender_itself_flattens_a_flat_mesh_without_distortion():
    mesh = irregular_disk()
    flat = Mesh(mesh.vertices * [1, 1, 0], mesh.faces)
    for name in DISK_METHODS:
        uv = mapped(name, flat).uv
        edges = flat.faces[:, [0, 1]]
        lengths = [np.linalg.norm(np.diff(p[edges], axis=1), axis=2) for p in (uv, flat.vertices)]
        assert_allclose(*lengths, rtol=2e-3)  # float32, and ABF++ ends its steps early
    assert len(np.unique(mapped("blender_smart_project", sphere()).charts())) > 1
    twice = Mesh(flat.vertices, np.concatenate([flat.faces, flat.faces[:1]]))
    with pytest.raises(UnsupportedError, match="two faces on the same vertices"):
        mapped("blender_smart_project", twice)
