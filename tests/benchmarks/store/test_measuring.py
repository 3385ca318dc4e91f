"""Metrics are computed once for each map, and anew when what they depend on changes."""

from __future__ import annotations

import json

import numpy as np
import pytest

from benchmarks import frame
from benchmarks.store import measuring, verifying
from benchmarks.store.results import Store
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization
from parapoint.surfaces.surface import PointCloud

from .conftest import FLAT, SQUARE, add


def test_metrics_are_computed_once_for_each_map(store, monkeypatch):
    row = add(store)
    add(store, status="failed", seed=1)
    frame = measuring.metrics(store)
    assert list(frame.columns[:6]) == list(measuring.IDENTITY_COLUMNS)
    assert frame["status"].tolist() == ["ok", "failed"]
    assert json.loads(frame["params"][0]) == {"sizes": [1, 2]}
    # A square onto itself: an isometry.
    assert frame["symmetric_dirichlet"][0] == pytest.approx(4)
    assert np.isnan(frame["symmetric_dirichlet"][1])
    assert frame["id"][0] == row.id
    monkeypatch.setattr(measuring, "measured", lambda *_: pytest.fail("computed again"))
    again = measuring.metrics(Store(store.folder))
    assert again.equals(frame)
    assert not measuring.unmeasured(store)


def test_metrics_follow_the_map_and_their_own_source(store, monkeypatch):
    add(store, status="failed")
    measuring.metrics(store)
    stretched = Parameterization(FLAT.uv * [2, 1], FLAT.corners)
    row = add(store, stretched)
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]
    assert measuring.metrics(store)["quasi_conformal_mean"][0] == pytest.approx(2)
    monkeypatch.setattr(measuring, "source_hash", lambda _: "another")
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]


def test_metrics_that_were_computed_elsewhere_are_taken_and_kept(store):
    rows = [add(store), add(store, seed=1)]
    frame = measuring.metrics(store, {rows[0].id: {"symmetric_dirichlet": 7.0}, rows[1].id: {}})
    assert frame["symmetric_dirichlet"][0] == 7
    assert frame["symmetric_dirichlet"].isna()[1]
    assert not measuring.unmeasured(store)
    faults = list(verifying.faults(store))
    assert any("symmetric_dirichlet is 7.0 in metrics.parquet" in fault for fault in faults)


def test_a_reference_joins_the_metrics_and_asks_for_them_anew(store):
    row = add(store, Parameterization(FLAT.uv * [2, 1], FLAT.corners))
    assert measuring.metrics(store)["artist_correlation"].isna().all()
    store.add_reference(row.surface_hash, FLAT)
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]
    # log sigma varies over the stretched map and not over the reference: no correlation.
    assert measuring.metrics(store)["artist_correlation"].tolist() == [1]
    assert not measuring.unmeasured(store)
    store.add_reference(row.surface_hash, Parameterization(FLAT.uv * 2, FLAT.corners))
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]


def test_a_damaged_table_is_made_anew(store, caplog):
    add(store)
    frame = measuring.metrics(store)
    (store.folder / "metrics.parquet").write_bytes(b"PAR1 rubbish")
    assert measuring.metrics(store).equals(frame)
    assert "damaged" in caplog.text


def test_only_rows_with_a_map_wait_for_their_metrics(store):
    add(store, status="failed")
    assert measuring.unmeasured(store) == []
    measuring.metrics(store)
    row = add(store, seed=1)
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]


def test_points_without_noise_ask_for_the_metrics_anew(store):
    points = np.random.default_rng(0).normal(size=(30, 3))
    cloud, image = PointCloud(points), PointParameterization(points[:, :2])
    row = add(store, image, cloud)
    before = measuring.metrics(store)["local_quasi_conformal_mean"][0]
    store.add_exact(row.surface_hash, PointCloud(points * [1, 1, 0]))
    assert [found.id for found in measuring.unmeasured(store)] == [row.id]
    # The map keeps x and y: on the flat points it is an isometry.
    assert measuring.metrics(store)["local_quasi_conformal_mean"][0] == pytest.approx(1)
    assert before > 1.1


@pytest.mark.parametrize(
    "damage",
    [
        lambda frame: frame.assign(seam_length=frame["seam_length"].astype(str)),
        lambda frame: frame.assign(seam_length=1),
        lambda frame: frame.assign(metrics_key="the same"),
        lambda frame: frame.drop(columns="id"),
        lambda frame: frame[frame.columns[::-1]],
    ],
)
def test_a_table_that_we_did_not_write_is_made_anew(store, caplog, damage):
    add(store)
    add(store, seed=1)
    frame = measuring.metrics(store)
    damage(frame).to_parquet(store.folder / "metrics.parquet", index=False)
    assert measuring.metrics(store).equals(frame)
    assert "damaged; computed anew" in caplog.text


def test_a_metric_that_is_no_longer_known_stays_in_the_table(store):
    row = add(store)
    frame = measuring.metrics(store, {row.id: {"older": 3.0, "symmetric_dirichlet": 4.0}})
    assert frame["older"].tolist() == [3]
    assert measuring.metrics(store).equals(frame)
    add(store, seed=1)
    assert measuring.metrics(store)["older"].tolist()[0] == 3


def test_a_folder_that_may_only_be_read_is_measured_too(store, monkeypatch):
    add(store)

    def refused(_):
        raise PermissionError("read-only")

    monkeypatch.setattr(measuring, "replacing", refused)
    assert measuring.metrics(store)["symmetric_dirichlet"][0] == pytest.approx(4)
    assert not (store.folder / "metrics.parquet").exists()


def test_a_map_of_another_kind_of_surface_is_bad_input_and_has_no_metrics(store, caplog):
    image = PointParameterization(SQUARE.vertices[:, :2])
    with pytest.raises(InputError, match="or the other way round"):
        measuring.measured(SQUARE, image)
    with pytest.raises(InputError, match="or the other way round"):
        measuring.measured(PointCloud(SQUARE.vertices), FLAT)
    add(store, image)
    assert measuring.metrics(store)["symmetric_dirichlet"].isna().all()
    assert "square, flat: no metrics" in caplog.text


def test_one_call_gives_everything_known_of_the_cells(store, tmp_path):
    add(store)
    add(store, status="failed", seed=1)
    table = frame(store.folder)
    assert table["status"].tolist() == ["ok", "failed"]
    assert table["grade"].isna().tolist() == [False, True]
    assert table["grade"].tolist()[0] == "usable"
    assert table["seconds"].isna().all()
    assert table["reason"].tolist() == ["", ""]
    assert table["symmetric_dirichlet"].tolist()[0] == pytest.approx(4)
    with pytest.raises(InputError, match="is no results folder"):
        frame(tmp_path / "nothing")
    assert not (tmp_path / "nothing").exists()
