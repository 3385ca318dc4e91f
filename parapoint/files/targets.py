"""What may be written, and how: nothing of the user's is lost, and nobody sees half a file.

The file that `--out` names may be replaced. The files beside it (a texture, a material) may be
replaced only if we wrote them and nobody has changed them since, which the seal at their end
tells; so may the picture of `--preview`. An input is never replaced, nor is a library or a picture
that an input names. `--force` lifts these rules. A write-protected file stays in any case.
"""

from __future__ import annotations

import hashlib
import logging
import os
import re
import secrets
import shutil
import struct
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from parapoint.errors import InputError
from parapoint.files.naming import files_named_in

SEAL = b"ParaPoint wrote this: "
"""What stands before the SHA-256 digest of all bytes that precede it in a file of ours."""
BEHIND_SEAL = 32
"""Most bytes behind the digest: a line's end, or the rest of a PNG file."""
PNG_END = b"\x00\x00\x00\x00IEND\xaeB`\x82"

logger = logging.getLogger("parapoint")


def checked_target(
    out: str | Path,
    *,
    sides: Iterable[str] = (),
    inputs: Iterable[str | Path] = (),
    force: bool = False,
) -> Path:
    """The file that is to be written for `out`, once it is known that it can and may be.

    Call it before any work. Where `out` is a symbolic link, that is the file it points to, and a
    warning says so.

    Args:
        out: the file that the user named.
        sides: endings (".png") of the files that will be written beside it, as `beside` names them.
        inputs: files that are read, which must not be replaced.
        force: replace whatever is there.

    Raises:
        InputError: the folder does not exist or cannot be written to; the name is too long; there
            is something other than a file, or a write-protected one; an input or a file of the
            user's would be replaced.
    """
    path = Path(out)
    try:
        if path.is_symlink():
            path = path.resolve()
            logger.warning("%s is a link: %s is written", out, path)
        files = [path, *(beside(path, ending) for ending in sides)]
        if not path.absolute().parent.is_dir():
            raise InputError(f"{path}: there is no such folder; make it first")
        for file in files:
            with suppress(FileNotFoundError):
                file.lstat()  # raises what is wrong with the name, where `exists` says False
            if file.exists() and not file.is_file():
                raise InputError(f"{file}: is a folder or a device, not a file; take another name")
        if not force:
            _check_inputs_stay(files, [Path(given) for given in inputs])
            _check_sides_stay(files[1:])
        _check_writable(files)
        _try(path)
    except (OSError, RuntimeError, ValueError) as error:  # links in a circle; a NUL in the name
        if isinstance(error, InputError):
            raise
        detail = getattr(error, "strerror", None) or error
        raise InputError(f"{out}: cannot be written: {detail}") from None
    return path


def check_folder(folder: Path) -> None:
    """Check that files can be written into a folder that is there.

    Raises:
        InputError: they cannot.
    """
    try:
        _try(folder / "file")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None


def _try(path: Path) -> None:
    """Write and remove a file beside `path`."""
    unfinished = _unfinished(path)
    unfinished.touch(exist_ok=False)
    unfinished.unlink()


def checked_picture(
    out: str | Path,
    *,
    inputs: Iterable[str | Path] = (),
    force: bool = False,
    is_side: bool = False,
) -> Path:
    """The PNG file that is to be written for `out`; see `checked_target`.

    Args:
        out: the file that the user named.
        inputs: files that are read, which must not be replaced.
        force: replace whatever is there.
        is_side: whether it comes beside the file of `--out`, and replaces a picture of ours alone.

    Raises:
        InputError: its name does not end in .png, or it cannot or may not be written.
    """
    if Path(out).suffix.lower() != ".png":
        raise InputError(f"{out}: a picture is written as PNG; give a name that ends in .png")
    path = checked_target(out, inputs=inputs, force=force)
    if is_side and not force:
        _check_sides_stay([path])
    return path


def beside(path: Path, ending: str) -> Path:
    """The file of this ending beside `path`, under a name that an OBJ file can write.

    Blanks, comment signs, quotation marks and backslashes become underscores.
    """
    return path.with_name(re.sub(r"[\s#\"'\\]", "_", path.stem) + ending)


def _check_inputs_stay(files: list[Path], inputs: list[Path]) -> None:
    there = [file for file in files if file.exists()]
    given = [path for path in inputs if path.is_file()] if there else []
    for file in there:
        if any(file.samefile(path) for path in given):
            raise InputError(f"{file}: is the input, which is not replaced; take another name")
    for path in given:
        named = files_named_in(path)
        for file in there:
            if any(file.samefile(one) for one in named):
                raise InputError(
                    f"{file}: is named by {path}, so it stays; take another name, or --force"
                )


def _check_sides_stay(sides: list[Path]) -> None:
    for side in sides:
        if side.is_symlink() or (side.exists() and not is_ours(side)):
            raise InputError(
                f"{side}: is a file of yours that would be replaced; take another name, or --force"
            )


def _check_writable(files: list[Path]) -> None:
    for file in files:
        if file.exists() and not os.access(file, os.W_OK):
            raise InputError(f"{file}: is write-protected; take another name, or make it writable")


@contextmanager
def complete_file(path: Path) -> Iterator[IO[bytes]]:
    """A file to write, which takes its name only at the end: nobody ever sees half of it.

    Where it replaces a file, it keeps who may read and write that.
    """
    unfinished = _unfinished(path)
    try:
        with unfinished.open("xb") as file:
            yield file
        with suppress(FileNotFoundError):
            shutil.copymode(path, unfinished)
        unfinished.replace(path)
    except OSError as error:
        # A full disk names no file, and nobody knows the name of the unfinished one.
        if error.filename in (None, str(unfinished)):
            error.filename, error.filename2 = str(path), None
        raise
    finally:
        with suppress(OSError):  # of a disk that has failed: what failed first is said
            unfinished.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a whole text file in UTF-8, or nothing."""
    with complete_file(path) as file:
        file.write(text.encode("utf-8"))


def _unfinished(path: Path) -> Path:
    """A name in the same folder that nobody uses, and that is short however long `path` is."""
    return path.with_name(f".parapoint-{os.getpid()}-{secrets.token_hex(4)}.part")


def is_ours(path: Path) -> bool:
    """Whether a file carries our seal and has not been changed since."""
    data = path.read_bytes()
    at = data.rfind(SEAL)
    end = at + len(SEAL) + 64
    return at >= 0 and data[at:end] == _seal(data[:at]) and len(data) - end <= BEHIND_SEAL


def _seal(before: bytes) -> bytes:
    return SEAL + hashlib.sha256(before).hexdigest().encode()


def sealed_text(text: str) -> bytes:
    """The text with a comment line (#) at its end that seals it."""
    before = f"{text}# ".encode(errors="surrogateescape")
    return before + _seal(before) + b"\n"


def sealed_png(data: bytes) -> bytes:
    """A PNG file with a text chunk before its end that seals it.

    Raises:
        ValueError: the data do not end as a PNG file does.
    """
    body = data.removesuffix(PNG_END)
    if body == data:
        raise ValueError("a PNG file ends with an IEND chunk")
    key = b"tEXtComment\x00"
    size = len(key) - 4 + len(SEAL) + 64
    before = body + struct.pack(">I", size) + key
    sealed = before + _seal(before)
    return sealed + struct.pack(">I", zlib.crc32(sealed[len(body) + 4 :])) + PNG_END
