import igl
import numpy as np
import pytest

from benchmarks.rendering import scene as scenes
from benchmarks.rendering.camera import camera
from benchmarks.rendering.colours import CLAY, DARK_TONE, LIGHT_TONE, linear
from benchmarks.rendering.rays import Rays
from benchmarks.rendering.scene import Scene, split
from benchmarks.rendering.viewpoints import two_cameras, upright
from parapoint.surfaces.surface import Mesh
from parapoint.testing import similar

Z, Y = np.eye(3)[2], np.eye(3)[1]


def square(height: float = 0.0) -> Mesh:
    corners = np.array([[0, 0, height], [1, 0, height], [1, 1, height], [0, 1, height]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def uv_of(mesh: Mesh) -> np.ndarray:
    return mesh.vertices[mesh.faces][..., :2]


def icosphere() -> Mesh:
    vertices, faces = igl.upsample(*igl.icosahedron(), 3)
    return Mesh(vertices / np.linalg.norm(vertices, axis=1, keepdims=True), faces)


def test_a_square_seen_from_above_fills_its_share_of_the_image():
    view = Scene(square(), shadows=False).view(camera(square(), Z, Y, margin=1.25), 50)
    image = view.image(np.ones((len(view.face), 3), dtype=np.float32), lit=False)
    assert image.shape == (50, 50, 4)
    # The square is 40 pixels wide, in the middle.
    assert image[..., 3].sum() == 255 * 40 * 40
    assert (image[5:45, 5:45] == 255).all()


def test_the_checkerboard_is_where_uv_says():
    mesh = square()
    view = Scene(mesh, shadows=False).view(camera(mesh, Z, Y, margin=1.0), 64)
    image = view.image(view.checker(uv_of(mesh), 4), lit=False)
    light = image[..., 0] > 128
    # Row 0 is the top, v = 1; the field at the origin, lower left, is light.
    fields = light.reshape(4, 16, 4, 16)[:, 8, :, 8]
    row, column = np.mgrid[3:-1:-1, 0:4]
    np.testing.assert_array_equal(fields, (row + column) % 2 == 0)


def test_a_fine_checkerboard_is_its_mean_without_noise():
    mesh = square()
    view = Scene(mesh, shadows=False).view(camera(mesh, Z, Y, margin=1.0), 32)
    tones = view.checker(uv_of(mesh), 32 * 100 + 0.37)
    mean = (LIGHT_TONE + DARK_TONE) / 2
    np.testing.assert_allclose(tones, np.broadcast_to(mean, tones.shape), atol=0.01)


def test_the_nearer_surface_hides_the_farther_one():
    near, far = square(1.0), square(0.0)
    both = Mesh(
        np.concatenate([near.vertices, far.vertices]), np.concatenate([near.faces, far.faces + 4])
    )
    view = Scene(both, shadows=False).view(camera(both, Z, Y), 20)
    assert set(view.face) == {0, 1}


def test_lines_behind_the_surface_are_not_drawn():
    mesh = square()
    view = Scene(mesh, shadows=False).view(camera(mesh, Z, Y), 64)
    line = np.array([[[0.1, 0.5, 0.0], [0.9, 0.5, 0.0]]])
    assert view.near_lines(line, 3).any()
    assert not view.near_lines(line - [0, 0, 0.5], 3).any()
    assert not view.near_lines(np.zeros((0, 2, 3)), 3).any()


def test_a_line_covers_the_width_asked_for_and_has_round_ends():
    mesh = square()
    view = Scene(mesh, shadows=False).view(camera(mesh, Z, Y, margin=1.0), 100)
    line = np.array([[[0.2, 0.5, 0.0], [0.8, 0.5, 0.0]]])
    cover = view.near_lines(line, 6).sum() / view.samples**2
    width = 6 + 1 / view.samples  # a sample counts as a whole
    assert cover == pytest.approx(60 * width + np.pi * (width / 2) ** 2, rel=0.02)


def test_edges_cover_the_width_asked_for():
    mesh = square()
    view = Scene(mesh, shadows=False).view(camera(mesh, Z, Y, margin=1.0), 200)
    cover = view.edge_cover(2.0).sum() / view.samples**2
    # The four sides lie half outside the image: 4 * 200 * 1, the diagonal 200 * sqrt(2) * 2.
    assert cover == pytest.approx(200 * (4 + 2 * np.sqrt(2)), rel=0.02)


def test_edges_never_fill_faces_that_are_small_on_the_screen():
    vertices, faces = igl.triangulated_grid(60, 60)
    fine = Mesh(np.column_stack([vertices, np.zeros(len(vertices))]), faces)
    cover = Scene(fine, shadows=False).view(camera(fine, Z, Y), 64).edge_cover(1.1)
    assert 0.1 < cover.mean() < 0.5


def test_the_picture_of_a_strip_is_no_thinner_than_a_quarter_of_its_length():
    strip = Mesh(square().vertices * [16, 1, 1], square().faces)
    np.testing.assert_allclose(camera(strip, Z, Y, margin=1.0).half, [8, 2])
    np.testing.assert_allclose(camera(square(), Z, Y, margin=1.5).half, [0.75, 0.75])


def test_both_ray_casters_see_the_same():
    pytest.importorskip("embreex")
    mesh = icosphere()
    rng = np.random.default_rng(0)
    origins = (3 * rng.normal(size=(500, 3))).astype(np.float32)
    directions = (rng.normal(size=(500, 3)) - origins).astype(np.float32)
    face, weights = Rays(mesh).first(origins, directions)
    other, other_weights = Rays(mesh, embree=False).first(origins, directions)
    assert (face >= 0).mean() > 0.3
    # A ray through an edge may go to either face.
    assert (face == other).mean() > 0.99
    same = (face == other) & (face >= 0)
    np.testing.assert_allclose(weights[same], other_weights[same], atol=1e-4)  # float32 rays
    assert (Rays(mesh).blocked(origins, directions) == (face >= 0)).all()


def test_openness_of_a_convex_shape_is_full_and_of_a_pit_is_not():
    assert Scene(icosphere()).openness[..., 0].min() > 0.97
    vertices, faces = igl.triangulated_grid(30, 30)
    x, y = vertices.T - 0.5
    pit = Mesh(np.stack([x, y, -0.8 * np.exp(-40 * (x**2 + y**2))], axis=1), faces)
    openness = Scene(pit).openness[..., 0]
    assert openness.min() < 0.5
    assert openness.max() > 0.95


def test_split_keeps_shape_parents_and_weights():
    mesh = Mesh(np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 1], [2, 2, 3]]), [[0, 1, 2], [1, 3, 2]])
    fine = split(mesh, 30)
    assert len(fine.mesh.faces) == 32
    expected = fine.weights @ mesh.vertices[mesh.faces[fine.parent]]
    np.testing.assert_allclose(fine.mesh.vertices[fine.mesh.faces], expected, atol=1e-12)
    np.testing.assert_allclose(fine.mesh.face_areas.sum(), mesh.face_areas.sum())


def test_coarse_and_split_faces_are_seen_alike(monkeypatch):
    mesh = square()
    at = camera(mesh, Z, Y)
    coarse = Scene(mesh).view(at, 40)
    monkeypatch.setattr(scenes, "FINE_FACES", 500)
    fine = Scene(mesh).view(at, 40)
    assert len(fine.scene.fine.parent) == 512
    board = [view.image(view.checker(uv_of(mesh), 3), lit=False) for view in (coarse, fine)]
    assert (np.abs(board[0].astype(int) - board[1]) > 2).mean() < 0.01


def test_a_mirrored_triangle_is_lit_from_its_own_side():
    mesh = square()
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    light = [Scene(m).view(camera(m, Z, Y), 16).light[0].mean() for m in (mesh, turned)]
    assert light[1] == pytest.approx(0.72 * light[0], rel=1e-3)


def test_a_square_that_faces_the_camera_is_lit_by_sky_key_and_fill():
    """Its normal is (0, 0, 1): three quarters of the sky, and the lights by their third part."""
    light = Scene(square(), shadows=False).view(camera(square(), Z, Y), 16).light[0]
    np.testing.assert_allclose(light, 0.50 * 0.75 + 0.62 * 0.71 + 0.12 * 0.59, rtol=1e-5)


def test_upright_stands_on_the_opening_or_on_a_flat_base():
    vertices, faces = igl.upsample(*igl.icosahedron(), 3)
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    for axis in range(3):
        for sign in (1, -1):
            kept = faces[(sign * vertices[faces][..., axis] > -0.7).all(axis=1)]
            np.testing.assert_array_equal(upright(Mesh(vertices, kept)), sign * np.eye(3)[axis])
    flattened = vertices.copy()
    flattened[:, 2] = np.maximum(flattened[:, 2], -0.6)
    np.testing.assert_array_equal(upright(Mesh(flattened, faces)), Z)
    np.testing.assert_array_equal(upright(Mesh(vertices, faces)), Y)


def test_two_cameras_show_both_sides_and_are_the_same_each_time():
    scene = Scene(icosphere())
    first, second = two_cameras(scene)
    assert first.axes[2] @ second.axes[2] < 0
    again = two_cameras(Scene(icosphere()))
    np.testing.assert_array_equal(first.axes, again[0].axes)
    for one in (first, second):
        np.testing.assert_allclose(one.axes @ one.axes.T, np.eye(3), atol=1e-12)
        assert (np.abs(one.screen(scene.mesh.vertices)[:, :2]) <= one.half).all()


def test_the_same_input_gives_the_same_bytes():
    images = []
    for _ in range(2):
        scene = Scene(icosphere())
        view = scene.view(two_cameras(scene)[0], 60)
        images.append(view.image(np.broadcast_to(CLAY, (len(view.face), 3))))
    assert images[0].tobytes() == images[1].tobytes()


@pytest.mark.parametrize(("shift", "scale"), [(6e6, 1), (0, 1e-6), (6e6, 1e-6), (0, 1e6)])
def test_a_picture_is_the_same_anywhere_and_in_any_unit(shift, scale):
    """A checkerboard in the shadows of a bumpy ball, but for one pixel in a hundred."""
    sphere = icosphere()
    bumps = 1 + 0.3 * np.sin(4 * sphere.vertices[:, :1]) * np.cos(5 * sphere.vertices[:, 1:2])
    home = Mesh(sphere.vertices * bumps, sphere.faces)
    uv = home.vertices[home.faces][..., :2]
    images = []
    for mesh in (home, similar(home, shift, scale)):
        scene = Scene(mesh)
        view = scene.view(camera(mesh, np.array([1.0, 0.4, 2.0]), Y), 80)
        images.append(view.image(view.checker(uv, 6)).astype(int))
    differ = np.abs(images[0] - images[1]).max(axis=2) > 2
    assert images[0][..., 3].any()
    assert differ.mean() <= 0.01


def test_degenerate_faces_and_unused_vertices_do_no_harm():
    mesh = square()
    odd = Mesh(
        np.concatenate([mesh.vertices, [[9.0, 9, 9]]]), np.concatenate([mesh.faces, [[0, 0, 1]]])
    )
    scene = Scene(odd)
    view = scene.view(two_cameras(scene)[0], 32)
    image = view.image(view.checker(np.zeros((3, 3, 2)), 5))
    assert np.isfinite(view.light[0]).all()
    assert image[..., 3].any()


def test_linear_light_of_srgb():
    np.testing.assert_allclose(linear([0.0, 0.5, 1.0]), [0.0, 0.21404, 1.0], atol=1e-5)
