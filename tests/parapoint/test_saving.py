"""Pairs of files: arrays and what names them."""

import json

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from parapoint import saving
from parapoint.errors import InputError

ARRAYS = {"a": np.arange(6.0).reshape(2, 3), "turned": np.arange(6).reshape(2, 3).T}
FACTS = {"name": "x", "count": np.int64(3), "share": np.float32(0.5)}


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_what_is_written_is_read_and_the_arrays_of_before_go(tmp_path):
    folder = tmp_path / "new" / "folder"
    (folder).mkdir(parents=True)
    (folder / "mine.txt").write_text("mine")
    saving.write(folder, "model", ARRAYS, FACTS)
    first = names(folder)
    arrays, facts = saving.read(folder, "model")
    for name, array in ARRAYS.items():
        assert_array_equal(arrays[name], array)
    assert (facts["name"], facts["count"], facts["share"]) == ("x", 3, 0.5)
    assert facts["format"] == saving.FORMAT
    saving.write(folder, "model", ARRAYS, FACTS)
    assert names(folder) == first
    saving.write(folder, "model", {"a": np.ones(1)}, FACTS)
    assert len(names(folder)) == 3
    assert names(folder) != first
    assert len(facts["tensors"]) == len("model-") + 16 + len(".safetensors")
    saving.remove(folder, "model")
    assert names(folder) == ["mine.txt"]
    saving.remove(folder, "model")


def test_another_version_and_other_arrays_are_refused(tmp_path):
    saving.write(tmp_path, "model", ARRAYS, FACTS)
    path = tmp_path / "model.json"
    text = path.read_text()
    path.write_text(text.replace(f'"format": {saving.FORMAT}', '"format": 999'))
    with pytest.raises(InputError, match="format version 999; this parapoint reads version"):
        saving.read(tmp_path, "model")
    path.write_text(text)
    (arrays,) = tmp_path.glob("*.safetensors")
    arrays.write_bytes(arrays.read_bytes() + b"0")
    with pytest.raises(InputError, match="its content does not fit its name"):
        saving.read(tmp_path, "model")
    for name in ("../x", "/etc/passwd", 3):
        path.write_text(json.dumps(json.loads(text) | {"tensors": name}))
        with pytest.raises(InputError, match="names tensors outside of its folder"):
            saving.read(tmp_path, "model")
    with pytest.raises(InputError, match="no saved model here"):
        saving.read(tmp_path, "other")


@pytest.mark.parametrize(
    "text",
    [
        "no json",
        "[]",
        "{}",
        '{"tensors": 3}',
        '{"tensors": "other-1.safetensors"}',
        '{"tensors": "model-1.txt"}',
        '{"tensors": "model-/../1.safetensors"}',
    ],
)
def test_what_is_not_ours_is_in_the_way_and_stays(tmp_path, text):
    path = tmp_path / "model.json"
    path.write_text(text)
    with pytest.raises(InputError, match="is in the way and not ours"):
        saving.check_free(tmp_path, "model")
    saving.check_free(tmp_path, "other")
    assert path.read_text() == text
    with pytest.raises(InputError, match="is a file; name a folder"):
        saving.check_free(path, "model")


def test_our_own_pair_is_not_in_the_way(tmp_path):
    saving.check_free(tmp_path / "none yet", "model")
    saving.write(tmp_path, "model", ARRAYS, FACTS)
    saving.check_free(tmp_path, "model")


def test_only_numbers_of_numpy_are_turned_into_json(tmp_path):
    with pytest.raises(TypeError, match="cannot be saved"):
        saving.write(tmp_path, "model", ARRAYS, {"what": object()})
