"""Reading files up to a limit, and writing them atomically."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

from marey.core.errors import InvalidFile, InvalidInput, NotFound, TooLarge
from marey.core.whole_files import whole_file


def stamp_of(path: Path | str | None) -> tuple[int, int]:
    """Return what changes when a file does; zeros where there is none."""
    try:
        status = Path("" if path is None else path).stat()
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


def read_limited(path: Path, limit: int) -> bytes:
    """Read a file.

    Args:
        limit: maximum size in bytes.

    Raises:
        NotFound: no such file.
        InvalidFile: it cannot be read, or is a pipe or a device, which may never end.
        TooLarge: over the limit.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
            raise InvalidFile("is not a regular file", where=str(path))
        if status.st_size > limit:
            message = f"{status.st_size / 2**20:.0f} MiB, over the limit of {limit / 2**20:.0f} MiB"
            raise TooLarge(message, where=str(path))
        return path.read_bytes()
    except (FileNotFoundError, ValueError):  # ValueError: a NUL in the path
        raise NotFound("no such file", where=str(path)) from None
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=str(path)) from None


def check_folder_of(path: Path) -> None:
    """Check that a file can get this name, before what it holds is made.

    Raises:
        InvalidInput: its folder is missing or cannot be written to.
    """
    folder = path.parent
    fault = errno.ENOTDIR if folder.exists() and not folder.is_dir() else errno.ENOENT if not folder.exists() else None
    if fault is None and not os.access(folder, os.W_OK | os.X_OK):
        fault = errno.EACCES
    if fault is not None:
        raise InvalidInput(f"cannot be written: {os.strerror(fault)}", where=str(path))


def write_atomically(path: Path, data: bytes) -> None:
    """Write a new file beside `path` and rename it, so that readers never see a partial file.

    Raises:
        InvalidInput: the folder is missing or cannot be written to.
    """
    try:
        with whole_file(path, durable=True) as part:
            part.write_bytes(data)
    except OSError as error:
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(path)) from None
