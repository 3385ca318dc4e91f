"""Parameterizations: charts and seams with answers counted by hand."""

import numpy as np
import pytest

from parapoint import InputError, Mesh, Parameterization, PointParameterization
from parapoint.surfaces.parameterization import Charted

# Two triangles of a square: 3-2 over 0-1, diagonal 0-2.
SQUARE = Mesh([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
UV = [[0.0, 0], [1, 0], [1, 1], [0, 1]]


def test_a_map_with_one_uv_per_vertex_has_one_chart_and_no_seam():
    result = Parameterization(UV, SQUARE.faces)
    assert result.charts().tolist() == [0, 0]
    assert len(result.seams(SQUARE)) == 0


def test_two_charts_are_cut_along_the_diagonal():
    result = Parameterization([*UV, [5.0, 5], [6, 6]], [[0, 1, 2], [4, 5, 3]])
    assert result.charts().tolist() == [0, 1]
    assert result.seams(SQUARE).tolist() == [[0, 2]]


def test_one_shared_corner_joins_no_charts_and_half_an_edge_is_a_seam():
    result = Parameterization([*UV, [6.0, 6]], [[0, 1, 2], [0, 4, 3]])
    assert len(set(result.charts())) == 2
    assert result.seams(SQUARE).tolist() == [[0, 2]]


def test_a_closed_surface_cut_along_a_path_has_that_path_as_its_seam():
    tetrahedron = Mesh(
        [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    )
    # vertex 3 is split in three: the net of the tetrahedron around face 0-2-1
    corners = [[0, 2, 1], [0, 1, 3], [1, 2, 4], [2, 0, 5]]
    uv = [[0.0, 0], [1, 0], [0, 1], [1, -1], [1, 1], [-1, 1]]
    result = Parameterization(uv, corners)
    assert result.charts().tolist() == [0, 0, 0, 0]
    assert result.seams(tetrahedron).tolist() == [[0, 3], [1, 3], [2, 3]]


def test_seams_of_another_mesh_are_refused():
    with pytest.raises(InputError, match="1 corner rows for a mesh of 2 faces"):
        Parameterization(UV, [[0, 1, 2]]).seams(SQUARE)


@pytest.mark.parametrize(
    ("uv", "corners", "message"),
    [
        ([[0, np.nan]], [[0, 0, 0]], "uv must be finite"),
        (UV, [[0, 1, 4]], "rows of uv, which run from 0 to 3"),
        (np.zeros((4, 3)), [[0, 1, 2]], r"uv must have shape \(n, 2\)"),
    ],
)
def test_bad_parameterizations_are_refused(uv, corners, message):
    with pytest.raises(InputError, match=message):
        Parameterization(uv, corners)


def test_a_point_parameterization_must_be_finite():
    with pytest.raises(InputError, match="uv must be finite; row 1"):
        PointParameterization([[0, 0], [np.inf, 0]])


def test_a_corner_with_itself_is_no_seam():
    """Two faces that name a vertex twice, in charts of their own."""
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 0, 1], [0, 0, 2]])
    uv = np.arange(18.0).reshape(9, 2)
    seams = Parameterization(uv, np.arange(9).reshape(3, 3)).seams(mesh)
    assert seams.tolist() == [[0, 1], [0, 2]]


def test_the_other_side_of_a_map_is_mirrored_and_flips_nothing():
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    turned = Charted(mesh, Parameterization([[0, 0], [1, 0], [0, 1]], mesh.faces)).turned()
    assert turned.mesh.faces.tolist() == [[2, 1, 0]]
    (a, b), (c, d), (e, f) = turned.map.uv[turned.map.corners[0]]
    assert (c - a) * (f - b) - (d - b) * (e - a) > 0
