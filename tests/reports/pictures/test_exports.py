import numpy as np
import pymeshlab
import pytest
import trimesh

from parapoint.errors import InputError
from parapoint.files.reading import read_parameterized
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud
from parapoint.testing import similar
from reports.contents import contents
from reports.pictures import exports

from ..conftest import HAND, Writer, ball, flat, lonlat, sheet


def turned_round(of: Parameterization) -> Parameterization:
    """The same map, its points in another order than the vertices."""
    return Parameterization(of.uv[::-1], len(of.uv) - 1 - of.corners)


@pytest.mark.parametrize(
    ("mesh", "result"),
    [
        (sheet(), flat(sheet())),
        (ball(), lonlat(ball())),
        (ball(), turned_round(lonlat(ball()))),
    ],
)
def test_other_programs_read_the_exports_back(tmp_path, mesh, result):
    exports.textured(tmp_path / "map", mesh, result)
    assert {path.name for path in tmp_path.iterdir()} == {
        "map.obj",
        "map.mtl",
        "map.png",
        "map.glb",
    }
    side = np.ptp(result.uv, axis=0).max()
    expected = ((result.uv - result.uv.min(axis=0)) / side)[result.corners]
    again, read = read_parameterized(tmp_path / "map.obj")
    np.testing.assert_array_equal(again.faces, mesh.faces)
    np.testing.assert_allclose(read.uv[read.corners], expected, atol=1e-15)
    shape = trimesh.load_mesh(tmp_path / "map.glb", process=False)
    material = shape.visual.material
    assert material.baseColorTexture.size == (1024, 1024)
    # Colours as they are, of no metal and no mirror, and on the back of an open mesh, too.
    assert material.doubleSided
    assert material.metallicFactor == 0 < material.roughnessFactor < 1
    np.testing.assert_allclose(shape.visual.uv[shape.faces], expected, atol=1e-6)
    np.testing.assert_allclose(shape.triangles, mesh.vertices[mesh.faces], atol=1e-6)
    lab = pymeshlab.MeshSet()
    lab.load_new_mesh(str(tmp_path / "map.obj"))
    found = lab.current_mesh().wedge_tex_coord_matrix().reshape(-1, 3, 2)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    assert lab.current_mesh().texture_number() == 1


def test_what_a_map_leaves_out_lies_in_a_corner_of_the_texture(tmp_path):
    mesh = sheet()
    uv = np.where(mesh.vertices[:, :1] > 0.5, np.nan, flat(mesh).uv)
    region = Parameterization(uv, mesh.faces)
    exports.textured(tmp_path / "map", mesh, region)
    _, read = read_parameterized(tmp_path / "map.obj")
    covered = region.covered
    kept = uv[mesh.faces][covered]
    expected = (kept - kept.min(axis=(0, 1))) / np.ptp(kept, axis=(0, 1)).max()
    np.testing.assert_allclose(read.uv[read.corners][covered], expected, atol=1e-15)
    left = read.uv[read.corners][~covered][np.isnan(uv[mesh.faces][~covered])]
    assert (left == 0).all()


def test_a_map_of_no_face_is_not_exported(tmp_path):
    mesh = sheet()
    with pytest.raises(InputError, match="covers no face"):
        exports.textured(
            tmp_path / "map", mesh, Parameterization(np.full((81, 2), np.nan), mesh.faces)
        )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("shift", "scale"), [(6e6, 1), (0, 1e-6), (6e6, 1e-6)])
@pytest.mark.parametrize("ending", ["obj", "glb"])
def test_exports_are_the_same_anywhere_and_in_any_unit(tmp_path, ending, shift, scale):
    """Triangles about their lowest corner, in sizes; UV; both as at home."""
    size = np.ptp(ball().vertices, axis=0).max()
    found = []
    for name, mesh, unit in (
        ("home", ball(), size),
        ("away", similar(ball(), shift, scale), size * scale),
    ):
        exports.textured(tmp_path / name, mesh, lonlat(ball()))
        read, flat_map = read_parameterized(tmp_path / f"{name}.{ending}")
        triangles = read.vertices[read.faces]
        found.append(
            (
                (triangles - triangles.min(axis=(0, 1))) / unit,
                flat_map.uv[flat_map.corners],
            )
        )
    (home, uv), (away, moved_uv) = found
    assert home.max() == pytest.approx(1, abs=1e-3)
    np.testing.assert_allclose(away, home, atol=1e-3)
    np.testing.assert_allclose(moved_uv, uv, atol=1e-3)


def test_exports_are_written_once_and_faults_told(tmp_path):
    writer = Writer(tmp_path)
    with writer.store.writing():
        lost = writer.cell(HAND, sheet(), "slim", {}, result=flat(sheet(), 0.5))
        writer.cell(HAND, sheet(), "arap", {}, status="failed")
        cloud = PointCloud(sheet().vertices)
        writer.cell("scan", cloud, "lscm", {}, result=PointParameterization(cloud.points[:, :2]))
        row = writer.cell(HAND, sheet(), "lscm", {}, result=flat(sheet()))
    (tmp_path / lost.uv_file).unlink()
    suite = contents(tmp_path)[0]
    report = tmp_path / "report"
    for _ in range(2):
        faults = exports.write(suite, report)
        assert len(faults) == 1
        assert "slim" in faults[0]
    assert exports.written(report, lost) == {}
    paths = [report / address for address in exports.written(report, row).values()]
    assert len(paths) == 2
    before = [path.stat().st_mtime_ns for path in paths]
    exports.write(suite, report)
    assert [path.stat().st_mtime_ns for path in paths] == before
