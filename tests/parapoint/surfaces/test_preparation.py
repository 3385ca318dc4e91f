"""What is done to a surface before a method sees it, and how its maps become one of the surface."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from parapoint import Mesh, Parameterization, PointCloud, clock
from parapoint.method import UnsupportedError
from parapoint.surfaces.parameterization import TracePoint
from parapoint.surfaces.preparation import Preparation, prepared, shelves
from parapoint.surfaces.surface import flat_faces
from parapoint.testing import irregular_disk, sphere

DISK_AFTER_CUT = frozenset({"faces", "disk_after_cut"})
REQUIRED = frozenset({"faces", "manifold", "oriented", "connected"})
TETRAHEDRON = Mesh(
    [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
)
DISK = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.faces[:3])


@dataclass(frozen=True)
class Shadow:
    """The first two coordinates of each vertex: an image tells whose it is."""

    requires: ClassVar[frozenset[str]] = DISK_AFTER_CUT

    def parameterize(self, surface, *, seed):
        if len(surface.faces) == seed:
            raise ValueError("will not")
        uv = surface.vertices[:, :2]
        area = float(surface.face_areas.sum())
        trace = tuple(TracePoint(k, 0.5 * k, {"area": area}, uv) for k in (1, 2))
        return Parameterization(uv, surface.faces, trace, {"faces": len(surface.faces)})


def mapped(mesh, requires=DISK_AFTER_CUT):
    """The preparation of a mesh, and its shadow."""
    preparation = prepared(mesh, requires)
    return preparation, preparation.joined(preparation.maps(Shadow(), 0))


def moebius(columns=12):
    """A strip of squares with a half twist; each square is two triangles."""
    angle = 2 * np.pi * np.arange(columns) / columns
    rim = []
    for side in (-1, 1):
        radius, height = 1 + side * 0.3 * np.cos(angle / 2), side * 0.3 * np.sin(angle / 2)
        rim.append(np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1))
    here = np.arange(columns)
    a, b = here, here + columns
    c, d = np.append(a[1:], columns), np.append(b[1:], 0)  # the end joins the start, turned over
    faces = np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])
    return Mesh(np.concatenate(rim), faces)


def pages(count):
    """Rectangles of width 1, 2, ... and height 1 that share an edge, as those of a book do."""
    points, faces = [[0.0, 0, 0], [0, 1, 0]], []
    for page in range(count):
        angle = 0.3 + 2 * np.pi * page / count  # none stands across the first axis
        x, z = (page + 1) * np.cos(angle), (page + 1) * np.sin(angle)
        k = len(points)
        points += [[x, 0, z], [x, 1, z]]
        faces += [[0, k, k + 1], [0, k + 1, 1]]
    return Mesh(points, faces)


def test_what_meets_the_words_is_handed_on_as_it_is():
    preparation, result = mapped(DISK)
    assert preparation.parts == (DISK,)
    assert preparation.steps == ""
    assert_array_equal(result.corners, DISK.faces)
    cloud = PointCloud(DISK.vertices)
    assert prepared(cloud, frozenset()).parts == (cloud,)


@pytest.mark.parametrize("mesh", [pages(3), moebius(), TETRAHEDRON])
def test_a_method_that_asks_for_faces_alone_gets_the_raw_mesh(mesh):
    preparation = prepared(mesh, frozenset({"faces"}))
    assert preparation.parts == (mesh,)
    assert preparation.steps == ""


def test_a_closed_surface_is_cut_and_the_step_is_named():
    preparation, result = mapped(TETRAHEDRON)
    assert [part.topology for part in preparation.parts] == ["disk"]
    assert preparation.steps == "automatic cut to a disk"
    assert_array_equal(result.uv[result.corners], TETRAHEDRON.vertices[TETRAHEDRON.faces][:, :, :2])


def test_a_littered_soup_becomes_the_surface_that_it_shows():
    whole = sphere()
    rng = np.random.default_rng(0)
    faces = whole.faces.copy()
    odd = rng.permutation(len(faces))[:40]
    faces[odd] = faces[odd][:, ::-1]
    a, b, c = faces[5]
    faces = np.concatenate([faces[:10], [[a, b, b], [b, c, a], [c, c, c]], faces[10:]])
    lone = [[7.0, 7, 7]]
    soup = Mesh(
        np.concatenate([lone, whole.vertices[faces].reshape(-1, 3)]),
        1 + np.arange(3 * len(faces)).reshape(-1, 3),
    )
    preparation, result = mapped(soup)
    assert preparation.steps == (
        f"welded {3 * len(faces) - 90} vertices; dropped 2 faces without area; dropped 1 duplicate "
        "face; dropped 1 unreferenced vertex; turned 40 faces; automatic cut to a disk"
    )
    assert [part.topology for part in preparation.parts] == ["disk"]
    # Each corner, those of dropped faces too, has the image of its place.
    assert_array_equal(result.uv[result.corners], soup.vertices[soup.faces][:, :, :2])
    assert [point.iteration for point in result.trace] == [1, 2]
    # Only the cut is a seam: the faces beside one without area are joined through the weld.
    assert len(np.unique(result.charts())) == 2  # the point is a chart of its own


@pytest.mark.parametrize(
    "sheet",
    [
        Mesh(np.eye(3), [[0, 1, 2]]),
        Mesh(np.random.default_rng(1).random((6, 3)), [[0, 1, 2], [5, 4, 3]]),
        irregular_disk(),
        pages(3),
        TETRAHEDRON,
    ],
    ids=["a triangle", "two apart", "a disk", "a book", "a closed surface, inside and outside"],
)
def test_the_two_sides_of_a_sheet_are_parted(sheet):
    count = len(sheet.faces)
    order = np.random.default_rng(0).permutation(2 * count)
    both = np.concatenate([sheet.faces, sheet.faces[:, [0, 2, 1]]])[order]
    preparation = prepared(Mesh(sheet.vertices, both), REQUIRED)
    assert f"parted the two sides of {count} face" in preparation.steps
    assert "duplicate" not in preparation.steps
    result = preparation.joined(preparation.maps(Shadow(), 0))
    front, back = (result.corners[np.isin(order, count * k + np.arange(count))] for k in (0, 1))
    assert np.intersect1d(front, back).size == 0
    assert "turned" not in preparation.steps
    # The image of each face is its shadow, at the scale of its part.
    at, uv = sheet.vertices[both][:, :, :2], result.uv[result.corners]
    for k in range(3):
        along, image = (of[:, (k + 1) % 3] - of[:, k] for of in (at, uv))
        assert_allclose(along[:, 0] * image[:, 1], along[:, 1] * image[:, 0], atol=1e-9)
        assert ((along * image).sum(axis=1) >= 0).all()


@pytest.mark.parametrize("is_last", [False, True])
def test_an_odd_face_that_turns_against_its_surface_is_the_other_side(is_last):
    """Wherever it stands in the file, the surface stays as it is."""
    whole = irregular_disk()
    odd = whole.faces[[7], ::-1]
    faces = np.concatenate([whole.faces, odd] if is_last else [odd, whole.faces])
    preparation = prepared(Mesh(whole.vertices, faces), REQUIRED)
    assert preparation.steps == "parted the two sides of 1 face; packed 2 components"
    assert sorted(len(part.faces) for part in preparation.parts) == [1, len(whole.faces)]


def test_a_one_sided_sheet_of_which_each_face_is_there_both_ways_is_mapped():
    mesh = moebius()
    both = Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[:, ::-1]]))
    preparation = prepared(both, REQUIRED)
    assert f"parted the two sides of {len(mesh.faces)} faces" in preparation.steps
    result = preparation.joined(preparation.maps(Shadow(), 0))
    front, back = np.split(result.corners, 2)
    assert np.intersect1d(front, back).size == 0


def test_a_copy_that_turns_alike_lies_on_the_face_that_was_kept():
    mesh = Mesh(DISK.vertices, np.concatenate([DISK.faces, DISK.faces[:, [1, 2, 0]]]))
    preparation, result = mapped(mesh)
    assert preparation.steps == "dropped 3 duplicate faces"
    assert_array_equal(result.corners[:3], np.roll(result.corners[3:], 1, axis=1))


def test_a_face_with_its_vertex_on_its_long_edge_leaves_no_slit():
    whole = sphere()
    a, c, d = whole.faces[0]
    middle = len(whole.vertices)
    # The face on the other side of c-a is split at the middle; this one is not.
    other = next(f for f in whole.faces[1:].tolist() if {a, c} <= set(f))
    apex = next(vertex for vertex in other if vertex not in (a, c))
    rest = [f for f in whole.faces.tolist() if f not in ([a, c, d], other)]
    points = np.concatenate([whole.vertices, whole.vertices[[a, c]].mean(axis=0, keepdims=True)])
    faces = [[a, middle, c], [c, middle, apex], [middle, a, apex], *rest, [a, c, d]]
    mesh = Mesh(points, faces)
    assert mesh.topology == "sphere"
    assert flat_faces(mesh.vertices, mesh.faces).sum() == 1
    preparation, result = mapped(mesh)
    assert preparation.steps == (
        "flipped the long edge of 1 face without area; automatic cut to a disk"
    )
    (disk,) = preparation.parts
    assert len(disk.faces) == len(mesh.faces)
    assert disk.topology == "disk"
    assert not flat_faces(disk.vertices, disk.faces).any()
    assert_allclose(disk.face_areas.sum(), whole.face_areas.sum(), rtol=1e-12)
    assert_array_equal(result.uv[result.corners], points[mesh.faces][:, :, :2])


@pytest.mark.parametrize("words", [{"oriented"}, {"manifold", "oriented", "connected"}])
def test_what_is_to_turn_alike_has_faces_with_area(words):
    """A triangle lies on the rim of another, with a vertex in the middle of its long edge."""
    points = [[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [1, 0, 0]]
    mesh = Mesh(points, [[0, 1, 2], [1, 0, 3]])
    assert mesh.topology == "disk"
    preparation = prepared(mesh, frozenset(words))
    assert preparation.steps == "flipped the long edge of 1 face without area"
    (part,) = preparation.parts
    assert_allclose(part.face_areas, [0.5, 0.5])
    assert prepared(mesh, frozenset({"manifold"})).parts == (mesh,)


def test_pages_of_a_book_are_split_and_packed_in_one_scale():
    book = pages(4)
    preparation, result = mapped(book)
    assert preparation.steps == (
        "split 1 non-manifold edge; split 2 non-manifold vertices; packed 4 components"
    )
    images = result.uv[result.corners]
    sides = images[:, 1:] - images[:, :1]
    uv_areas = np.abs(np.linalg.det(sides)).reshape(4, 2).sum(axis=1) / 2
    areas = np.array([1.0, 2.0, 3.0, 4.0])
    assert_allclose(uv_areas, areas, rtol=1e-12)
    boxes = images.reshape(4, 6, 2)
    low, high = boxes.min(axis=1), boxes.max(axis=1)
    for one in range(4):
        for other in range(one):
            assert ((high[one] < low[other]) | (high[other] < low[one])).any()
    assert [(point.iteration, point.seconds) for point in result.trace] == [(1, 2.0), (2, 4.0)]
    assert result.trace[0].values == {"area": pytest.approx((areas**2).sum() / areas.sum())}
    assert_array_equal(result.trace[1].uv, result.uv)
    assert result.report == {"components": 4, "largest": {"faces": 2}}


def test_only_what_is_asked_for_is_done():
    bow_tie = Mesh(
        [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]], [[0, 1, 2], [0, 3, 4]]
    )
    (part,) = prepared(bow_tie, frozenset({"manifold"})).parts
    assert part.topology == "2 components"
    assert prepared(bow_tie, frozenset({"connected"})).parts == (bow_tie,)
    assert len(prepared(bow_tie, frozenset({"connected", "manifold"})).parts) == 2
    turned = Mesh(
        DISK.vertices, np.where([[True], [False], [False]], DISK.faces[:, ::-1], DISK.faces)
    )
    preparation = prepared(turned, frozenset({"oriented"}))
    assert preparation.steps == "turned 1 face"
    assert preparation.parts[0].topology == "disk"


def test_a_one_sided_surface_is_cut_open():
    strip = moebius()
    preparation, result = mapped(strip)
    assert preparation.parts[0].topology == "disk"
    assert "cut a one-sided surface along" in preparation.steps
    assert_array_equal(result.uv[result.corners], strip.vertices[strip.faces][:, :, :2])


def test_an_error_names_its_component():
    disk = irregular_disk()
    two = Mesh(
        np.concatenate([disk.vertices, TETRAHEDRON.vertices + 9]),
        np.concatenate([disk.faces, TETRAHEDRON.faces + len(disk.vertices)]),
    )
    preparation = prepared(two, DISK_AFTER_CUT)
    assert preparation.steps == ("packed 2 components; automatic cut to a disk (1 of 2 components)")
    with pytest.raises(ValueError, match="will not") as caught:
        preparation.maps(Shadow(), 4)
    assert caught.value.__notes__ == ["(component 2 of 2, 4 faces)"]


@dataclass(frozen=True)
class Hasty:
    """Works for half of the seconds that it is given, and maps as `Shadow` does."""

    given: list
    now: list
    time_budget: float | None = 12.0

    def parameterize(self, surface, *, seed):
        self.given.append(self.time_budget)
        self.now[0] += (self.time_budget or 0) / 2
        return Shadow().parameterize(surface, seed=seed)


@pytest.mark.parametrize(
    ("budget", "expected"), [(12.0, [4.0, 10.0]), (None, [None, None]), (1e-9, [0.01, 0.01])]
)
def test_parts_share_the_time_that_is_left_by_their_faces(budget, expected, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(clock, "worked", lambda: now[0])
    given: list[float | None] = []
    sizes = [4, 8]  # a third of the faces gets 4 of 12 s, and leaves 2 of these to the others
    disk = irregular_disk()
    parts = tuple(Mesh(disk.vertices, disk.faces[:size]) for size in sizes)
    maps = Preparation(parts).maps(Hasty(given, now, budget), 3)
    assert given == pytest.approx(expected) if budget else given == expected
    assert [len(of.corners) for of in maps] == sizes


def test_one_part_has_all_of_the_time():
    given: list[float | None] = []
    Preparation((irregular_disk(),)).maps(Hasty(given, [0.0]), 3)
    assert given == [12.0]


@pytest.mark.parametrize("seed", range(40))
def test_any_faces_whatever_become_planar_domains(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 12))
    points = rng.integers(0, 4, (count, 3)).astype(float)
    faces = rng.integers(0, count, (int(rng.integers(4, 40)), 3))
    preparation, result = mapped(Mesh(points, faces))
    assert all(part.is_planar_domain for part in preparation.parts)
    kept = ~flat_faces(points, faces)
    if len(preparation.parts) == 1:
        images = points[faces][:, :, :2]
        assert_array_equal(result.uv[result.corners][kept], images[kept])
    assert sum(len(part.faces) for part in preparation.parts) <= len(faces)


def test_what_cannot_be_mended_is_refused_with_the_reason():
    with pytest.raises(UnsupportedError, match="needs a disk; the surface is sphere"):
        prepared(TETRAHEDRON, frozenset({"disk"}))
    line = Mesh([[0.0, 0, 0], [1, 1, 1], [3, 3, 3]], [[0, 1, 2], [0, 0, 1]])
    with pytest.raises(UnsupportedError, match="no face of the surface has any"):
        prepared(line, DISK_AFTER_CUT)


def test_an_unknown_word_is_a_bug_of_the_method():
    with pytest.raises(KeyError, match="flat"):
        prepared(DISK, frozenset({"flat"}))


def test_shelves_hold_every_box_apart_and_fill_a_page_that_is_about_square():
    sizes = np.random.default_rng(1).uniform(0.2, 1, (40, 2))
    low = shelves(sizes)
    high = low + sizes
    apart = (high[:, None] < low[None]).any(axis=2)
    apart |= apart.T
    assert apart[~np.eye(40, dtype=bool)].all()
    width, height = high.max(axis=0) - low.min(axis=0)
    assert sizes.prod(axis=1).sum() > 0.6 * width * height
    assert 0.6 < width / height < 1.6


@pytest.mark.parametrize("sizes", [(1.0, 5.0), (5.0, 1.0)])
def test_the_report_of_several_parts_is_that_of_the_largest(sizes):
    disk = irregular_disk()
    count = len(disk.vertices)
    both = Mesh(
        np.concatenate([sizes[0] * disk.vertices, sizes[1] * disk.vertices + 50]),
        np.concatenate([disk.faces, disk.faces + count]),
    )
    ready = prepared(both, frozenset({"faces", "connected"}))
    maps = [
        Parameterization(part.vertices[:, :2], part.faces, report={"area": part.face_areas.sum()})
        for part in ready.parts
    ]
    report = ready.joined(maps).report
    assert report["components"] == 2
    assert report["largest"]["area"] == pytest.approx(25 * disk.face_areas.sum())
