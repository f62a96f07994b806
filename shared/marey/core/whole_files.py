"""Files that appear under their name when all of them is written. Standard library only."""

from __future__ import annotations

import os
import secrets
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

LONGEST = 40
"""Characters of the name of a file that its part has, too: file systems take names of 255 bytes."""


@contextmanager
def whole_file(path: Path, *, private: bool = False, durable: bool = False, alone: bool = False) -> Generator[Path]:
    """Give the path of an empty file beside `path`, to be written in the block, behind which it takes the name `path`.
    If the block raises, it is removed, and what was at `path` stays.

    Args:
        path: of the file; its folder exists.
        private: readable by its owner alone.
        durable: written to the disk before it takes the name.
        alone: no other process writes this file: the part has one name, so that large files of a process that was
            killed do not pile up.

    Raises:
        OSError: the file cannot be written or renamed.
    """
    name = path.name if alone else f"{path.name[:LONGEST]}.{secrets.token_hex(4)}"
    part = path.with_name(f".{name}.part")
    flags = os.O_WRONLY | os.O_CREAT | (os.O_TRUNC if alone else os.O_EXCL)
    os.close(os.open(part, flags, 0o600 if private else 0o666))
    try:
        yield part
        if durable:
            _to_disk(part)
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
