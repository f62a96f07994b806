"""Read BVH files from a `.tar.xz` archive or a folder. Paths in the archive are never used for extraction."""

from __future__ import annotations

import tarfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

from marey.core.errors import InvalidFile, MareyError, NotFound, TooLarge

MAX_FILE_BYTES = 64 * 2**20  # the largest file of the two archives has 11 MB
MAX_TOTAL_BYTES = 4 * 2**30  # the larger archive unpacks to 548 MB; stops decompression bombs
MAX_FILES = 100_000
BVH, NO_ENDING, SPECIAL = ".bvh", "without an ending", "links and devices"
"""Kinds of members; files of other endings have theirs."""


def bvh_files(path: Path, passed_over: Counter[str] | None = None) -> Iterator[tuple[str, bytes]]:
    """Yield the BVH files of an archive or folder: stem of the name, and content.

    Links, devices and other file types are passed over; only the last part of a path is used.

    Args:
        path: the archive or folder.
        passed_over: is increased by the number of members of an archive that are passed over, by kind, such as `.txt`.

    Raises:
        NotFound: the path does not exist.
        InvalidFile: not an archive, truncated, or two members with one name.
        TooLarge: more bytes or files than any known archive has.
    """
    if path.is_dir():
        members = _folder(path)
    elif path.is_file():
        members = _archive(path, Counter() if passed_over is None else passed_over)
    else:
        raise NotFound("no such archive or folder", where=str(path))
    seen: set[str] = set()
    total = 0
    for name, data in members:
        total += len(data)
        if total > MAX_TOTAL_BYTES or len(seen) >= MAX_FILES:
            raise TooLarge(
                f"more than {MAX_TOTAL_BYTES >> 30} GiB or {MAX_FILES:,} files",
                where=str(path),
                hint="This is not one of the archives that can be prepared.",
            )
        if name in seen:
            raise InvalidFile(f"two files are called {name}.bvh", where=str(path))
        seen.add(name)
        yield name, data
    if not seen:
        raise InvalidFile("holds no BVH file", where=str(path))


def _folder(path: Path) -> Iterator[tuple[str, bytes]]:
    for file in sorted(path.rglob("*")):
        if file.suffix.lower() == BVH and file.is_file() and not file.is_symlink():
            _check_size(file.stat().st_size, str(file))
            yield file.stem, file.read_bytes()


def _archive(path: Path, passed_over: Counter[str]) -> Iterator[tuple[str, bytes]]:
    try:
        with tarfile.open(path, "r|*") as tar:
            for member in tar:
                name = PurePosixPath(member.name)
                if member.isdir():
                    continue
                kind = (name.suffix.lower() or NO_ENDING) if member.isreg() else SPECIAL
                if kind != BVH:
                    passed_over[kind] += 1
                    continue
                _check_size(member.size, f"{path}: {member.name}")
                file = tar.extractfile(member)
                data = file.read(member.size + 1) if file else b""
                if len(data) != member.size:
                    raise InvalidFile("is truncated", where=f"{path}: {member.name}")
                yield name.stem, data
    except MareyError:
        raise
    except Exception as error:  # a crafted header makes tarfile raise nearly any exception
        raise InvalidFile(f"not a readable archive: {error}", where=str(path)) from error


def _check_size(size: int, where: str) -> None:
    if size > MAX_FILE_BYTES:
        raise TooLarge(f"{size:,} bytes are more than {MAX_FILE_BYTES:,} for one BVH file", where=where)
