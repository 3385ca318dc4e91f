"""Pictures of every kind that is read, and those that are refused."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from parapoint import InputError
from parapoint.files.meshes.pictures import MOST_TEXELS, read_picture

DEEP = np.array([[0, 257, 32_896], [51_400, 65_000, 65_535]], dtype=np.uint16)
"""Grey of 16 bits, and what it is of 8."""
SHALLOW = [[0, 1, 128], [200, 253, 255]]


@pytest.mark.parametrize("name", ["a.png", "a.tif", "big.tif", "a.pgm"])
def test_grey_of_16_bits_keeps_its_range(name: str, tmp_path: Path) -> None:
    """Whatever the byte order is."""
    path = tmp_path / name
    if name == "big.tif":
        Image.frombytes("I;16B", (3, 2), DEEP.astype(">u2").tobytes()).save(path)
    elif name == "a.pgm":
        path.write_bytes(b"P5 3 2 65535\n" + DEEP.astype(">u2").tobytes())
    else:
        Image.fromarray(DEEP).save(path)
    picture = read_picture(path)
    assert picture.dtype == np.uint8
    assert picture.tolist() == [[[of] * 3 for of in row] for row in SHALLOW]


def test_grey_of_16_bits_keeps_what_is_not_seen(tmp_path: Path) -> None:
    Image.fromarray(DEEP).save(tmp_path / "a.png", transparency=257)
    picture = read_picture(tmp_path / "a.png")
    assert picture[..., 0].tolist() == SHALLOW
    assert picture[..., 3].tolist() == [[255, 0, 255], [255, 255, 255]]


@pytest.mark.parametrize("kind", [np.int32, np.float32])
def test_numbers_of_no_known_range_are_refused(kind: type, tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    Image.fromarray(DEEP.astype(kind)).save(path)
    said = f"^{re.escape(str(path))}: is a picture of numbers of no known range; save it"
    with pytest.raises(InputError, match=said):
        read_picture(path)


@pytest.mark.parametrize(
    ("bound", "size"), [(10, (4, 4)), (4, (4, 4)), (None, (MOST_TEXELS + 1, 1))]
)
@pytest.mark.filterwarnings("error")
def test_the_bound_of_a_picture_is_ours(
    bound: int | None, size: tuple[int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Pillow warns above a bound of its own, and raises above its double; it keeps that bound."""
    path = tmp_path / "a.png"
    Image.new("L", size).save(path)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", bound)
    if max(size) <= MOST_TEXELS:
        assert read_picture(path).shape == (4, 4, 3)
    else:
        said = f"{path}: is a picture of 16,385 by 1 texels; at most 16,384 along a side are read"
        with pytest.raises(InputError, match=f"^{re.escape(said)}: make it smaller$"):
            read_picture(path)
    assert bound == Image.MAX_IMAGE_PIXELS
