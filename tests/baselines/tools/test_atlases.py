"""The makers of atlases, and external programs."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from baselines import registry
from baselines.tools.atlas import atlas, first_rows, joined_corners, row_numbers
from baselines.tools.meshlab import matched_faces
from baselines.tools.optional import Missing, optional
from parapoint.errors import InputError
from parapoint.files.writing.mesh_writers import write_textured
from parapoint.method import MissingError, UnsupportedError
from parapoint.planar.domains import FlatteningError
from parapoint.surfaces.areas import signed_areas
from parapoint.surfaces.parameterization import Charted
from parapoint.surfaces.surface import Mesh
from parapoint.testing import irregular_disk, sphere
from parapoint.textures.checkerboard import checkerboard


def mapped(spec, mesh):
    return registry.method(spec)[1].parameterize(mesh, seed=0)


def cube():
    """The unit cube, two triangles a side."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    sides = np.array(
        [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    )
    return Mesh(corners, np.concatenate([sides[:, [0, 1, 2]], sides[:, [0, 2, 3]]]))


def edge_ratios(mesh, result):
    """Length in the plane over length in space of each halfedge."""
    uv, points = result.uv[result.corners], mesh.vertices[mesh.faces]
    return np.linalg.norm(uv - np.roll(uv, 1, axis=1), axis=2) / np.linalg.norm(
        points - np.roll(points, 1, axis=1), axis=2
    )


@pytest.mark.parametrize("spec", ["xatlas", "uvunwrap"])
def test_cube_is_unfolded_without_distortion(spec):
    # Both divide by the width and height of their page: on the page of a cube's six squares, which
    # is not square itself, a map taken as it comes is stretched.
    pytest.importorskip(spec)
    ratios = edge_ratios(cube(), mapped(spec, cube()))
    assert_allclose(ratios, ratios[0, 0], rtol=2e-3)  # float32, texels


@pytest.mark.parametrize("spec", ["xatlas", "uvunwrap"])
def test_flat_mesh_is_one_chart_and_a_cube_is_more(spec):
    pytest.importorskip(spec)
    flat = irregular_disk()
    flat = Mesh(flat.vertices * [1, 1, 0], flat.faces)
    assert mapped(spec, flat).charts().max() == 0
    assert mapped(spec, cube()).charts().max() > 0


def test_xatlas_charts_are_whole_mirrored_or_not():
    mesh = sphere()
    result = mapped("xatlas", mesh)
    areas, charts = signed_areas(result.uv, result.corners), result.charts()
    for chart in range(charts.max() + 1):
        assert len(np.unique(np.sign(areas[charts == chart]))) == 1
    # A quarter turn while packing mirrors a chart once more.
    upright = mapped("xatlas(fix_winding=True, rotate_charts=False)", mesh)
    assert (signed_areas(upright.uv, upright.corners) > 0).all()


def test_xatlas_options_reach_the_library():
    mesh = sphere()
    plain = mapped("xatlas", mesh).charts().max()
    assert mapped("xatlas(max_chart_area=0.5)", mesh).charts().max() > plain
    assert mapped("xatlas(max_cost=0.5)", mesh).charts().max() > plain
    small, padded = (mapped(f"xatlas(padding={p})", mesh).uv for p in (0, 16))
    assert not np.array_equal(small, padded)
    aligned = mapped("xatlas(block_align=True, brute_force=True, resolution=64)", mesh)
    assert not np.array_equal(aligned.uv, mapped("xatlas(resolution=64)", mesh).uv)


def test_xatlas_lays_pages_side_by_side():
    mesh = sphere()
    result = mapped("xatlas(resolution=64, texels_per_unit=30)", mesh)
    page = result.uv[result.corners][:, :, 0] // 64
    assert page.max() >= 1
    assert_array_equal(page, page[:, [0, 0, 0]])  # no face lies on two pages


def test_xatlas_takes_faces_without_area():
    mesh = irregular_disk()
    faces = np.concatenate([mesh.faces, [[0, 1, 1], [0, 1, 2]]])
    result = mapped("xatlas", Mesh(mesh.vertices, faces))
    assert result.report["unplaced_faces"] >= 1
    assert_array_equal(result.corners.shape, faces.shape)


def test_atlas_refuses_faces_that_are_not_the_mesh_s():
    mesh = irregular_disk()
    rows = np.arange(len(mesh.vertices))
    given = {"source": rows, "uv": mesh.vertices[:, :2], "page_size": (2, 3), "page": 0 * rows}
    assert_allclose(atlas(mesh, corners=mesh.faces, **given).uv, mesh.vertices[:, :2] * [2, 3])
    for wrong in (mesh.faces[::-1], mesh.faces[1:]):
        with pytest.raises(FlatteningError, match="not the mesh's 128 in order"):
            atlas(mesh, corners=wrong, **given)
    with pytest.raises(FlatteningError, match="not finite"):
        atlas(mesh, corners=mesh.faces, **{**given, "uv": np.full((len(rows), 2), np.nan)})


def test_pages_lie_side_by_side_and_faces_on_none_are_counted():
    """A triangle each on pages 0 and 1, one on no page, and one with a corner on none."""
    faces = np.arange(12).reshape(-1, 3)
    uv = np.tile([[0.0, 0], [1, 0], [0, 1]], (4, 1))
    page = np.array([0, 0, 0, 1, 1, 1, -1, -1, -1, 2**32 - 1, 0, 0])
    made = atlas(
        Mesh(np.eye(3)[np.arange(12) % 3], faces),
        source=np.arange(12),
        corners=faces,
        uv=uv,
        page_size=(20, 10),
        page=page,
    )
    assert made.report == {"unplaced_faces": 2}
    shift = np.repeat([[0, 0], [20, 0], [0, 0], [0, 0]], 3, axis=0)
    assert_allclose(made.uv, uv * [20, 10] + shift)


def test_rows_are_numbered_as_they_first_appear():
    rows = np.random.default_rng(1).integers(-2, 3, size=(400, 3)) / 2
    rows[::7] *= -1.0  # -0.0 equals 0.0
    number = row_numbers(*rows.T)
    first = first_rows(number)
    assert_array_equal(rows[first][number], rows)
    assert len(first) == len(np.unique(rows + 0.0, axis=0))
    assert (np.diff(first) > 0).all()
    assert_array_equal(number[first], np.arange(len(first)))


def test_a_corner_that_is_not_finite_is_not_joined_with_another():
    mesh = irregular_disk()
    uv = mesh.vertices[mesh.faces][:, :, :2]
    assert len(joined_corners(mesh, uv).uv) == len(mesh.vertices)
    number = row_numbers(mesh.faces.reshape(-1)).reshape(-1, 3)
    uv[number == number.max()] = np.nan  # of the vertex that comes last
    with pytest.raises(FlatteningError, match="not finite"):
        joined_corners(mesh, uv)


def test_meshlab_faces_are_found_again():
    mesh = sphere()
    rng = np.random.default_rng(5)
    order = rng.permutation(len(mesh.faces))
    order = np.concatenate([order, order[:7]])  # some twice
    turn = rng.integers(0, 3, len(order))
    shuffled = mesh.faces[order][np.arange(len(order))[:, None], (np.arange(3) + turn[:, None]) % 3]
    face, first = matched_faces(mesh, mesh.vertices, shuffled)
    again = shuffled[face][np.arange(len(face))[:, None], (np.arange(3) + first[:, None]) % 3]
    assert_array_equal(again, mesh.faces)
    assert (face < len(mesh.faces)).all()  # the first of those that stand twice
    with pytest.raises(FlatteningError, match=f"left out 1 of {len(mesh.faces)} faces"):
        matched_faces(mesh, mesh.vertices, mesh.faces[1:])


def test_meshlab_voronoi_maps_faces_in_order():
    pytest.importorskip("pymeshlab")
    mesh = sphere()
    result = mapped("meshlab_voronoi(regions=8)", mesh)
    assert 2 <= len(np.unique(result.charts())) <= 12
    with pytest.raises(UnsupportedError, match="at least 92 vertices for 46 regions; there are 90"):
        mapped("meshlab_voronoi(regions=46)", mesh)
    # Corners in the wrong place would break each triangle: the cells of a sphere are mild.
    ratios = edge_ratios(mesh, result)
    assert np.median(ratios.max(axis=1) / ratios.min(axis=1)) < 1.5


def test_meshlab_triangles_are_one_chart_each():
    pytest.importorskip("pymeshlab")
    result = mapped("meshlab_triangles", sphere())
    assert len(np.unique(result.charts())) == len(sphere().faces)
    close, apart = (
        np.abs(signed_areas(made.uv, made.corners)).sum()
        for made in (mapped(f"meshlab_triangles(border={b})", sphere()) for b in (0, 8))
    )
    assert apart < 0.8 * close
    with pytest.raises(FlatteningError, match="Failed to apply filter"):
        mapped("meshlab_triangles(page_size=8)", sphere())


def test_meshlab_says_nothing(capfd):
    pytest.importorskip("pymeshlab")
    mapped("meshlab_harmonic", irregular_disk())
    assert capfd.readouterr().out == ""


def test_a_filter_that_fails_leaves_meshlab_whole(tmp_path):
    """A process that goes on reads texture coordinates without a crash."""
    pytest.importorskip("pymeshlab")
    write_textured(tmp_path / "map.obj", Charted(cube(), mapped("xatlas", cube())), checkerboard())
    code = (
        "import sys; from baselines import registry; from parapoint.testing import sphere\n"
        "try: registry.method('meshlab_triangles(page_size=8)')[1].parameterize(sphere(), seed=0)\n"
        "except RuntimeError: pass\n"
        "import matplotlib.figure, pymeshlab; meshes = pymeshlab.MeshSet()\n"
        "meshes.load_new_mesh(sys.argv[1]); read = meshes.current_mesh()\n"
        "print(read.wedge_tex_coord_matrix().shape[0], read.texture_number())"
    )
    command = [sys.executable, "-c", code, tmp_path / "map.obj"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["36", "1"]


def test_panic_of_uvunwrap_is_a_failure_of_the_method(monkeypatch):
    uvunwrap = pytest.importorskip("uvunwrap")
    panic = type("PanicException", (BaseException,), {})

    def generate(*_, **__):
        raise panic("index out of bounds")

    monkeypatch.setattr(uvunwrap, "generate", generate)
    with pytest.raises(FlatteningError, match="uvunwrap panicked: index out of bounds"):
        mapped("uvunwrap", cube())


def test_uvatlas_options_reach_the_library():
    pytest.importorskip("open3d", exc_type=ImportError)
    flat = irregular_disk()
    flat = Mesh(flat.vertices * [1, 1, 0], flat.faces)
    few, result = mapped("uvatlas(max_stretch=1)", sphere()), mapped("uvatlas", flat)
    assert result.charts().max() == 0
    assert_allclose(edge_ratios(flat, result), edge_ratios(flat, result)[0, 0], rtol=2e-2)
    assert mapped("uvatlas(max_stretch=0)", sphere()).charts().max() > few.charts().max()
    assert 256 < np.ptp(result.uv, axis=0).max() <= 512
    close, apart = (mapped(f"uvatlas(size=128, gutter={g})", sphere()) for g in (1, 20))
    assert np.ptp(close.uv, axis=0).max() <= 128
    used = [np.abs(signed_areas(made.uv, made.corners)).sum() for made in (close, apart)]
    assert used[1] < 0.8 * used[0]
    for stretch in (1.1, -0.1):
        with pytest.raises(InputError, match="max_stretch must lie between 0 and 1"):
            registry.method(f"uvatlas(max_stretch={stretch})")


def test_missing_package_says_what_to_install():
    missing = optional("no_such_package", "pip install it")
    assert isinstance(missing, Missing)
    with pytest.raises(MissingError, match="needs the package no_such_package: pip install it"):
        missing.Atlas()
    assert not hasattr(missing, "__len__")
    assert optional("json", "").dumps(1) == "1"


def test_method_of_a_missing_package_is_unsupported(monkeypatch):
    gone = Missing("needs the package open3d: pip install open3d")
    monkeypatch.setattr("baselines.tools.uvatlas.open3d", lambda: gone)
    for module, name in (
        ("xatlas_charts", "xatlas"),
        ("uvunwrap", "uvunwrap"),
        ("meshlab", "pymeshlab"),
    ):
        gone = Missing(f"needs the package {name}: pip install {name}")
        monkeypatch.setattr(f"baselines.tools.{module}.{name}", gone)
    for spec in (
        *("xatlas", "uvatlas", "uvunwrap"),
        *("meshlab_lscm", "meshlab_harmonic", "meshlab_voronoi", "meshlab_triangles"),
    ):
        with pytest.raises(MissingError, match="pip install"):
            mapped(spec, irregular_disk())


@pytest.mark.parametrize(
    ("program", "fault"),
    [
        ("import sys; sys.exit('no licence')", "ended with status 1: no licence"),
        ("import sys; sys.exit('first\\nlast')", "ended with status 1: last$"),
        ("import sys; print('so\\nit is'); sys.exit(3)", "ended with status 3: it is$"),
        ("import sys; sys.exit(4)", "ended with status 4: $"),
        ("pass", "wrote no UV map: .*no such file"),
        ("import shutil, sys; shutil.copy(*sys.argv[1:3])", "wrote no UV map: .*no UV"),
        (
            (
                "import sys; open(sys.argv[2], 'w')"
                ".write('v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nvt 0 0\\nf 1/1 2/1 3/1\\n')"
            ),
            "changed the faces",
        ),
    ],
)
def test_external_program_that_fails_says_why(tmp_path, program, fault):
    script = tmp_path / "tool with space.py"
    script.write_text(program)
    with pytest.raises(FlatteningError, match=fault):
        mapped(
            f"external(command={f'{sys.executable} {str(script)!r} {{input}} {{output}}'!r})",
            cube(),
        )


def test_external_program_must_exist_and_have_places():
    with pytest.raises(MissingError, match="needs the program no_such_tool"):
        mapped("external(command='no_such_tool {input} {output}')", cube())
    for spec in ("external", "external(command='tool {input}')"):
        with pytest.raises(InputError, match=r"needs \{(input|output)\}"):
            registry.method(spec)


ROUNDING = """import sys
rows = [line.split() for line in open(sys.argv[1])]
points = [[float(x) for x in row[1:]] for row in rows if row[0] == "v"]
with open(sys.argv[2], "w") as file:
    for x, y, z in points:
        print("v", x + {step}, y, z, file=file)
        print("vt", x, y, file=file)
    for row in rows:
        if row[0] == "f":
            print("f", *(f"{{k}}/{{k}}" for k in row[1:]), file=file)
"""
"""A program that maps each vertex to its x and y, and writes its x with an error."""


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_external_program_may_round_but_not_move_vertices(tmp_path, size):
    flat = irregular_disk()
    flat = Mesh(flat.vertices * size / np.ptp(flat.vertices, axis=0).max(), flat.faces)
    script = tmp_path / "tool.py"
    spec = f"external(command={f'{sys.executable} {script} {{input}} {{output}}'!r})"
    script.write_text(ROUNDING.format(step=9e-5 * size))
    assert_allclose(mapped(spec, flat).uv, flat.vertices[:, :2])
    script.write_text(ROUNDING.format(step=2e-4 * size))
    with pytest.raises(FlatteningError, match="changed the faces"):
        mapped(spec, flat)
