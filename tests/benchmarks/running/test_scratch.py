import pytest

from benchmarks.running import scratch
from parapoint import InputError


def test_a_scratch_folder_is_made_cleared_and_removed(tmp_path):
    folder = tmp_path / "results" / scratch.NAME
    scratch.clear(folder)
    (folder / "map.npz").write_text("left by a run that was killed")
    scratch.clear(folder)
    assert [path.name for path in folder.iterdir()] == [scratch.MARK]
    scratch.remove(folder)
    assert not folder.exists()


def test_what_we_did_not_make_is_neither_cleared_nor_removed(tmp_path):
    theirs = tmp_path / scratch.NAME
    theirs.mkdir()
    (theirs / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="is in the way and not ours"):
        scratch.clear(theirs)
    scratch.remove(theirs)
    assert (theirs / "thesis.tex").read_text() == "years of work"


def test_a_link_to_a_scratch_folder_is_not_followed(tmp_path):
    ours = tmp_path / "elsewhere"
    scratch.clear(ours)
    link = tmp_path / scratch.NAME
    link.symlink_to(ours)
    scratch.remove(link)
    assert (ours / scratch.MARK).exists()
    with pytest.raises(InputError, match="not ours"):
        scratch.clear(link)
