import numpy as np
import pytest
from numpy.testing import assert_allclose

from parapoint import Mesh, Parameterization
from parapoint.surfaces.parameterization import Charted
from parapoint.textures import texels as room
from parapoint.textures.texels import RIM, texels


def flat(uv, faces) -> Charted:
    """A mesh that lies in the plane of its map."""
    uv = np.asarray(uv, dtype=float)
    return Charted(
        Mesh(np.column_stack([uv, np.zeros(len(uv))]), faces), Parameterization(uv, faces)
    )


SQUARE = flat([[0.25, 0.25], [0.75, 0.25], [0.75, 0.75], [0.25, 0.75]], [[0, 1, 2], [0, 2, 3]])


def places_of(shown) -> np.ndarray:
    """(K, 3) the places of the mesh that the texels show."""
    corners = shown.charted.mesh.vertices[shown.charted.mesh.faces[shown.faces]]
    return np.einsum("nc,ncd->nd", shown.weights(slice(None)), corners)


def test_a_square_fills_the_texels_whose_centres_it_holds() -> None:
    shown = texels(SQUARE, 8)
    image = np.zeros(64, dtype=bool)
    image[shown.places[shown.inside]] = True
    wanted = np.zeros((8, 8), dtype=bool)
    wanted[2:6, 2:6] = True
    assert np.array_equal(image.reshape(8, 8), wanted)


def test_each_texel_shows_the_place_of_its_centre_on_the_rim_too() -> None:
    shown = texels(SQUARE, 64)
    line, column = np.divmod(shown.places, 64)
    centres = np.stack([column + 0.5, 64 - line - 0.5], axis=1) / 64
    assert_allclose(places_of(shown)[:, :2], centres, atol=1e-12)
    beyond = np.abs(centres - 0.5).max(axis=1) - 0.25
    assert (beyond < (RIM + 1) / 64).all()  # a little farther only at the triangles' tips
    assert ((beyond > 0) == ~shown.inside).all()
    ring = (beyond > 0) & (beyond < 1 / 64)
    assert ring.sum() == 34 * 34 - 32 * 32


def test_batches_do_not_matter(monkeypatch) -> None:
    rng = np.random.default_rng(0)
    uv = rng.random((40, 2))
    charted = flat(uv, rng.permutation(40)[:39].reshape(-1, 3))
    whole = texels(charted, 50)
    monkeypatch.setattr(room, "CANDIDATES", 1)
    parts = texels(charted, 50)
    assert np.array_equal(whole.places, parts.places)
    assert np.array_equal(whole.faces, parts.faces)


def test_mirrored_triangles_show_and_flat_ones_do_not() -> None:
    mirrored = texels(flat(SQUARE.map.uv, [[0, 2, 1], [0, 3, 2]]), 8)
    assert mirrored.inside.sum() == 16
    line = flat([[0.1, 0.1], [0.5, 0.5], [0.9, 0.9]], [[0, 1, 2]])
    assert len(texels(line, 8).places) == 0


def test_where_triangles_overlap_the_deeper_one_shows() -> None:
    small, large = [[0.4, 0.4], [0.6, 0.4], [0.4, 0.6]], [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    shown = texels(flat(small + large, [[0, 1, 2], [3, 4, 5]]), 16)
    assert (shown.faces[shown.inside] == 1).sum() > (shown.faces == 0).sum()


def test_slivers_are_not_continued_far() -> None:
    sliver = flat([[0.1, 0.5], [0.9, 0.5], [0.5, 0.5 + 1e-5]], [[0, 1, 2]])
    weights = texels(sliver, 32).weights(slice(None))
    assert np.abs(weights - 1 / 3).max() <= 1.5 + 1e-12
    assert_allclose(weights.sum(axis=1), 1)


@pytest.mark.parametrize("size", [1, 16])
def test_maps_at_the_edge_of_the_square_stay_inside(size) -> None:
    full = flat([[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1, 2], [0, 2, 3]])
    assert texels(full, size).inside.sum() == size * size
