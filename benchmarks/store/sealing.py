"""Sealed archives: a ZIP file of results whose last bytes are the hash of all others.

The same members give the same bytes, on any day and in any folder. Members are stored as they are,
without packing, so that none decodes to more than the archive holds; and each has one of the names
that results have, so that none is written anywhere else.
"""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path

from benchmarks.store.archives import disk_said, replacing
from parapoint.errors import InputError

NAMES = re.compile(r"(manifest|environment)\.json|(rows|metrics)\.jsonl|uv/[0-9a-f]{8,64}\.npz")
"""The names that a member may have."""
SEAL = b"sha256:"
SEAL_LENGTH = len(SEAL) + 64
EPOCH = (1980, 1, 1, 0, 0, 0)
"""The date of every member: the oldest that ZIP knows."""
BLOCK = 1 << 20
"""Bytes that are hashed at a time."""


def is_sealed(path: Path) -> bool:
    """Whether a file ends as a sealed archive does; its hash is not checked."""
    return path.is_file() and _seal(path).startswith(SEAL)


def _seal(path: Path) -> bytes:
    with path.open("rb") as stream:
        stream.seek(max(0, path.stat().st_size - SEAL_LENGTH))
        return stream.read()


def write(path: Path, members: Mapping[str, bytes | Path]) -> None:
    """Write a sealed archive: all of it or nothing.

    Args:
        path: where to.
        members: by name, the content of each, or the file that has it.

    Raises:
        InputError: the disk is full.
    """
    with disk_said(path), replacing(path) as stream:
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_STORED, strict_timestamps=True) as archive:
            for name in sorted(members):
                content = members[name]
                info = zipfile.ZipInfo(name, EPOCH)
                info.create_system = 3
                info.external_attr = 0o644 << 16
                data = content.read_bytes() if isinstance(content, Path) else content
                archive.writestr(info, data)
            archive.comment = bytes(SEAL_LENGTH)
        stream.flush()
        digest = hashlib.sha256()
        left = stream.tell() - SEAL_LENGTH
        with Path(stream.name).open("rb") as written:
            while left:
                block = written.read(min(BLOCK, left))
                digest.update(block)
                left -= len(block)
        stream.seek(-SEAL_LENGTH, 2)
        stream.write(SEAL + digest.hexdigest().encode())


def unpack(path: Path, folder: Path) -> list[str]:
    """Write the members of a sealed archive below `folder`, once all of it is known to be whole.

    Returns:
        Their names.

    Raises:
        InputError: the file is missing, no sealed archive, or not as it was sealed; a member has a
            name that none may have.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such archive")
    seal = _seal(path)
    if not (seal.startswith(SEAL) and len(seal) == SEAL_LENGTH):
        raise InputError(
            f"{path}: is no archive that `python -m benchmarks publish` wrote: it has no seal"
        )
    digest, left = hashlib.sha256(), path.stat().st_size - SEAL_LENGTH
    with path.open("rb") as stream:
        while left:
            block = stream.read(min(BLOCK, left))
            digest.update(block)
            left -= len(block)
    if seal != SEAL + digest.hexdigest().encode():
        raise InputError(f"{path}: has been changed since it was published: its seal is broken")
    try:
        with zipfile.ZipFile(path) as archive:
            infos = archive.infolist()
            names = [info.filename for info in infos]
            for info in infos:
                if not NAMES.fullmatch(info.filename) or names.count(info.filename) > 1:
                    raise InputError(f"{path}: {info.filename!r} is no name that a member may have")
                if info.compress_type != zipfile.ZIP_STORED:
                    raise InputError(f"{path}: {info.filename} is packed; members are stored")
            for name in names:
                target = folder / name
                target.parent.mkdir(parents=True, exist_ok=True)
                with disk_said(target):
                    target.write_bytes(archive.read(name))
    except (zipfile.BadZipFile, ValueError, EOFError, NotImplementedError) as error:
        raise InputError(f"{path}: is no archive of results ({error})") from None
    return names
