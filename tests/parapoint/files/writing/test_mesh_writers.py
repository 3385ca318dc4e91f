"""Textured meshes as OBJ, GLB and PLY, and PNG files, read back by other programs' readers."""

import io

import numpy as np
import pytest
import trimesh
from numpy.testing import assert_allclose
from PIL import Image

from parapoint import InputError, Mesh, Parameterization
from parapoint.files.png import png
from parapoint.files.reading import read_parameterized, read_surface
from parapoint.files.targets import is_ours
from parapoint.files.writing.mesh_writers import write_textured
from parapoint.surfaces.parameterization import Charted

TENT = Charted(
    Mesh(
        [[0, 0, 0], [1, 0, 1], [1, 2, 1], [0, 2, 0], [2, 0, 0], [2, 2, 0]],
        [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]],
    ),
    Parameterization(  # cut along the ridge, vertices 1 and 2
        np.array([[0, 0], [0.4, 0], [0.4, 1], [0, 1], [0.6, 0], [1, 0], [1, 1], [0.6, 1]]),
        [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]],
    ),
)
TEXTURE = np.random.default_rng(0).integers(0, 256, (16, 8, 3), dtype=np.uint8)


def test_glb_holds_the_texture_bit_for_bit_and_smooth_normals(tmp_path) -> None:
    far = Charted(Mesh(TENT.mesh.vertices + np.array([5e5, 4e6, 0]), TENT.mesh.faces), TENT.map)
    write_textured(tmp_path / "a.glb", far, TEXTURE)
    mesh, own = read_parameterized(tmp_path / "a.glb")
    wanted = far.mesh.vertices[far.mesh.faces]
    assert_allclose(mesh.vertices[mesh.faces], wanted, rtol=0, atol=1e-6)
    assert len(own.seams(mesh)) == 1
    assert_allclose(own.uv[own.corners], TENT.map.uv[TENT.map.corners], atol=1e-6)
    loaded = next(iter(trimesh.load(tmp_path / "a.glb").geometry.values()))
    assert np.array_equal(np.asarray(loaded.visual.material.baseColorTexture), TEXTURE)
    assert loaded.visual.material.metallicFactor == 0
    ridge = np.abs(loaded.vertices[:, 0]) < 1e-6  # around the middle
    assert ridge.sum() == 4
    order = np.argsort(loaded.vertices[ridge, 1], kind="stable")
    first, same, second, again = loaded.vertex_normals[ridge][order]
    assert_allclose(first, same)  # both sides of the seam are shaded alike
    assert_allclose(second, again)
    assert first[2] > 0.9


@pytest.mark.parametrize("is_closed", [True, False])
def test_a_sheet_in_a_glb_file_is_seen_from_both_sides(is_closed, tmp_path) -> None:
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])[: 4 if is_closed else 3]
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces)
    uv = np.tile([[0.0, 0], [1, 0], [0, 1]], (len(faces), 1))
    corners = np.arange(len(uv)).reshape(-1, 3)
    write_textured(tmp_path / "a.glb", Charted(mesh, Parameterization(uv, corners)), TEXTURE)
    loaded = next(iter(trimesh.load(tmp_path / "a.glb").geometry.values()))
    assert bool(loaded.visual.material.doubleSided) is not is_closed


@pytest.mark.parametrize("ending", [".obj", ".ply"])
def test_side_files_are_sealed_and_named(ending, tmp_path) -> None:
    path = tmp_path / f"my tent{ending}"
    write_textured(path, TENT, TEXTURE)
    image = tmp_path / "my_tent.png"
    assert is_ours(image)
    assert np.array_equal(np.asarray(Image.open(image)), TEXTURE)
    if ending == ".ply":
        assert b"comment TextureFile my_tent.png\n" in path.read_bytes()
        mesh = read_surface(path)
        assert len(mesh.vertices) == 8
        assert_allclose(mesh.vertices[mesh.faces], TENT.mesh.vertices[TENT.mesh.faces])
    else:
        mesh, own = read_parameterized(path)
        assert np.array_equal(mesh.faces, TENT.mesh.faces)
        assert np.array_equal(own.corners, TENT.map.corners)


def test_other_endings_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="is written as"):
        write_textured(tmp_path / "a.stl", TENT, TEXTURE)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_png_files_are_read_as_they_were_written(kind, channels) -> None:
    pixels = np.random.default_rng(0).integers(0, np.iinfo(kind).max, (5, 7, channels)).astype(kind)
    with Image.open(io.BytesIO(png(pixels, {"said": "so"}))) as image:
        read = np.asarray(image)
        assert image.info["said"] == "so"
    if kind is np.uint16 and channels > 1:  # Pillow keeps the high bytes
        assert np.array_equal(read, pixels >> 8)
    else:
        assert np.array_equal(read.reshape(pixels.shape), pixels)


@pytest.mark.parametrize(
    "pixels",
    [
        np.zeros((2, 2), np.uint8),
        np.zeros((2, 2, 2), np.uint8),
        np.zeros((0, 2, 3), np.uint8),
        np.zeros((2, 2, 3)),
    ],
)
def test_what_is_no_picture_is_refused(pixels) -> None:
    with pytest.raises(InputError, match="a texture must be"):
        png(pixels)
