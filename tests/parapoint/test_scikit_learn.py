"""Estimators among those of scikit-learn, and with what other libraries hold as surfaces."""

import pickle
from types import SimpleNamespace

import igl
import matplotlib as mpl
import numpy as np
import pytest
import torch
import trimesh
from scipy import sparse
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils.estimator_checks import estimator_checks_generator
from sklearn.utils.validation import check_is_fitted

from parapoint import ComputedMap, InputError, Mesh, NotFittedError, ParaPoint, PointCloud
from parapoint.estimator import load
from parapoint.surfaces.foreign import surface_or_array

FEW = "it fits 30 points at most; a surface needs 100"
COLUMNS = "it fits points of other than three coordinates"
GAPS = "it wants rows with NaN refused; scans have them, so they are left out and counted"
SPECIAL = "its data are of another kind: one sample, one column, text or none"
EXEMPT = {
    "check_fit_score_takes_y": FEW,
    "check_dont_overwrite_parameters": FEW,
    "check_pipeline_consistency": FEW,
    "check_estimators_pickle": FEW,
    "check_f_contiguous_array_estimator": FEW,
    "check_transformer_data_not_an_array": FEW,
    "check_transformer_general": FEW,
    "check_transformer_preserve_dtypes": FEW,
    "check_methods_sample_order_invariance": FEW,
    "check_methods_subset_invariance": FEW,
    "check_dict_unchanged": FEW,
    "check_fit2d_predict1d": FEW,
    "check_estimators_overwrite_params": COLUMNS,
    "check_estimators_fit_returns_self": COLUMNS,
    "check_readonly_memmap_input": COLUMNS,
    "check_n_features_in_after_fitting": COLUMNS,
    "check_positive_only_tag_during_fit": COLUMNS,
    "check_estimators_dtypes": COLUMNS,
    "check_dtype_object": COLUMNS,
    "check_fit_idempotent": COLUMNS,
    "check_fit_check_is_fitted": COLUMNS,
    "check_n_features_in": COLUMNS,
    "check_estimator_sparse_tag": COLUMNS,
    "check_estimators_nan_inf": GAPS,
    "check_estimators_empty_data_messages": SPECIAL,
    "check_fit2d_1sample": SPECIAL,
    "check_fit2d_1feature": SPECIAL,
    "check_array_api_input": SPECIAL,
}
"""Checks of scikit-learn that cannot apply, each with its reason. The tests below hold what most of
them are after, on points of a surface."""


def paraboloid(count: int = 300) -> np.ndarray:
    xy = np.random.default_rng(0).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * (xy**2).sum(axis=1)]) * 7 + [10.0, -5.0, 2.0]


@pytest.fixture(scope="module")
def fitted() -> ComputedMap:
    return ComputedMap().fit(paraboloid())


@pytest.mark.filterwarnings("ignore:Estimator .* does not inherit:UserWarning")
@pytest.mark.parametrize("model", [ComputedMap(), ParaPoint("paper")], ids=repr)
def test_it_passes_the_checks_of_scikit_learn(model) -> None:
    done = 0
    for estimator, check in estimator_checks_generator(model, mark=None):
        if check.func.__name__ not in EXEMPT:
            check(estimator)
            done += 1
    assert done >= 17


def test_it_is_cloned_and_takes_its_place_in_a_pipeline() -> None:
    model = ComputedMap(points=250, distortion="conformal")
    assert clone(model) == model
    piped = make_pipeline(StandardScaler(), clone(model))
    uv = piped.fit_transform(paraboloid())
    assert uv.shape == (300, 2)
    np.testing.assert_array_equal(piped.transform(paraboloid()), uv)
    check_is_fitted(piped)
    assert not hasattr(model, "points_")


def test_fit_transform_is_fit_then_transform(fitted) -> None:
    uv = ComputedMap().fit_transform(paraboloid())
    np.testing.assert_array_equal(uv, fitted.transform(paraboloid()))


def test_a_fit_changes_neither_its_input_nor_its_parameters_and_can_be_repeated() -> None:
    points = paraboloid()
    points.setflags(write=False)
    model = ComputedMap(points=np.int64(250), seed=np.uint8(3))
    before = model.get_params()
    once = model.fit(points).transform(points)
    assert model.get_params() == before
    np.testing.assert_array_equal(model.fit(np.asfortranarray(points)).transform(points), once)
    np.testing.assert_array_equal(model.transform(points.tolist()), once)


def test_it_is_pickled_with_its_map(fitted) -> None:
    again = pickle.loads(pickle.dumps(fitted))  # noqa: S301 (our own)
    np.testing.assert_array_equal(again.transform(paraboloid()), fitted.transform(paraboloid()))


def test_whole_numbers_of_numpy_are_saved(tmp_path) -> None:
    ComputedMap(points=np.int32(250), seed=np.int64(3)).fit(paraboloid()).save(tmp_path / "model")
    assert load(tmp_path / "model").get_params()["points"] == 250


@pytest.mark.parametrize("use", ["transform", "inverse_transform", "seams", "plot", "mesh", "save"])
def test_before_a_fit_there_is_one_line(use, tmp_path) -> None:
    given = {"transform": [paraboloid()], "inverse_transform": [np.zeros((1, 2))]}
    given["save"] = [tmp_path / "model"]
    with pytest.raises(NotFittedError, match="not fitted; call fit or load first"):
        getattr(ComputedMap(), use)(*given.get(use, []))


def test_its_text_has_what_differs_from_the_defaults() -> None:
    assert repr(ComputedMap()) == "ComputedMap()"
    assert repr(ComputedMap(points=500, seed=2)) == "ComputedMap(points=500, seed=2)"
    assert repr(ParaPoint("paper", start="hull")) == "ParaPoint(preset='paper', start='hull')"


def test_a_notebook_shows_a_picture_once_it_is_fitted(fitted) -> None:
    assert ComputedMap(components="<b>")._repr_html_() == (
        "<code>ComputedMap(components=&#x27;&lt;b&gt;&#x27;)</code>"
    )
    assert "data:image/png;base64," in fitted._repr_html_()


def test_a_plot_is_a_figure_that_can_be_restyled(fitted) -> None:
    figure = fitted.plot()
    space, plane = figure.axes
    assert (space.get_title(), plane.get_title()) == ("surface", "map")
    drawn = plane.collections[0].get_offsets()
    np.testing.assert_allclose(drawn, fitted.transform(fitted.points_))
    plane.set_title("my map")
    assert isinstance(figure, mpl.figure.Figure)
    assert figure._repr_png_().startswith(b"\x89PNG")  # a notebook shows it without pyplot


def test_surfaces_of_other_libraries_are_taken() -> None:
    flat, faces = igl.triangulated_grid(17, 17)
    vertices = np.column_stack([flat, 0.2 * flat[:, 0] ** 2])
    ours = ComputedMap(points=500).fit(Mesh(vertices, faces)).transform(vertices)
    sheet = trimesh.Trimesh(vertices, faces, process=False)
    open3d_mesh = SimpleNamespace(vertices=vertices, triangles=faces)
    for mesh in (sheet, open3d_mesh):
        np.testing.assert_array_equal(ComputedMap(points=500).fit(mesh).transform(mesh), ours)
    bare = ComputedMap().fit(PointCloud(vertices)).transform(vertices)
    open3d_cloud = SimpleNamespace(points=vertices.tolist(), colors=[], normals=[])
    tensor = torch.tensor(vertices, requires_grad=True)
    for cloud in (trimesh.PointCloud(vertices), open3d_cloud, tensor):
        np.testing.assert_array_equal(ComputedMap().fit(cloud).transform(cloud), bare)


def test_points_of_other_libraries_that_are_not_finite_are_dropped(caplog) -> None:
    points = np.array([[0.0, 0, 0], [np.nan, 0, 0], [1, 0, 0], [0, 1, 0]])
    normals = np.array([[0.0, 0, 1], [0, 0, 1], [np.nan] * 3, [0, 0, 1]])
    colours = np.array([[1.0000001, 0, 0], [0, 0, 0], [0, 0.5, 0], [0, 0, 1]])
    cloud = surface_or_array(SimpleNamespace(points=points, normals=normals, colors=colours))
    assert isinstance(cloud, PointCloud)
    assert cloud.normals is not None
    assert cloud.normals[:, 2].tolist() == [1, 0, 1]
    assert cloud.attributes["colours"].tolist() == [[1, 0, 0], [0, 0.5, 0], [0, 0, 1]]
    assert cloud.rows_of(np.arange(3)).tolist() == [0, 2, 3]
    assert caplog.messages == ["dropped 1 of 4 points: not finite"]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (sparse.csr_array(np.eye(3)), "sparse"),
        (np.eye(3) * 1j, "Complex data not supported"),
        ([["a", "b", "c"]], "must be numbers"),
    ],
)
def test_what_is_no_coordinates_gets_one_line(fitted, given, message) -> None:
    with pytest.raises(InputError, match=message):
        fitted.transform(given)
