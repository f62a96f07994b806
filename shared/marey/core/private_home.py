"""The home of a server, closed to other users: it holds the database, assets, logs, keys and `server.json`.

Standard library only.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from marey.core.errors import InvalidInput

FOLDER_MODE, FILE_MODE = 0o700, 0o600
OPEN_TO_OTHERS = 0o077
UMASK = 0o077
"""Umask of all server processes: their files are private to the user."""
CLOSED_FROM_ABOVE = frozenset({"assets", "models", "postgres", "valkey"})
"""Folders of the home that are closed but not searched: they may hold a million files."""


def make_private(home: Path) -> list[str]:
    """Make the home private: create it, or remove the access of other users to an existing one and its content.

    Returns:
        Paths that were accessible until now, for a warning.

    Raises:
        InvalidInput: it cannot be made, written or closed, or belongs to another user.
    """
    try:
        home.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
        found = home.stat()
        if found.st_uid != os.geteuid():
            raise InvalidInput(
                f"belongs to the user {found.st_uid}, not to {os.geteuid()}, the user of this process",
                where=str(home),
                hint="Give it to this user with chown, or set MAREY_HOME to another folder.",
            )
        with tempfile.TemporaryFile(dir=home):
            pass
        closed = [_warning(path, mode) for path, mode in _close_all(home.resolve())]
    except OSError as error:
        raise InvalidInput(
            f"the folder of the embedded servers cannot be written ({error.strerror or error})",
            where=str(home),
            hint="Make it writable for this user, free some space, or set MAREY_HOME to another folder.",
        ) from error
    if home.stat().st_mode & OPEN_TO_OTHERS:
        raise InvalidInput(
            "is open to other users, and its file system does not let it be closed",
            where=str(home),
            hint="Set MAREY_HOME to a folder of a file system that has permissions.",
        )
    return closed


def open_private(path: Path, mode: str, **options: Any) -> IO[Any]:
    """Open a file; a new file is readable by its owner alone, independent of the umask."""
    return open(path, mode, opener=_opener, **options)  # Path.open has no opener


def is_open(folder: Path) -> bool:
    """Return True if other users may read an existing folder."""
    return folder.exists() and bool(folder.stat().st_mode & OPEN_TO_OTHERS)


def _opener(path: str, flags: int) -> int:
    return os.open(path, flags, FILE_MODE)


def _close_all(home: Path) -> Iterator[tuple[Path, int]]:
    """Close the home first, so that no file can be added meanwhile; yield each path with its previous mode."""
    yield from _close(home)
    for folder, folders, files in os.walk(home):
        for name in (*folders, *files):
            yield from _close(Path(folder) / name)
        if folder == str(home):
            folders[:] = [name for name in folders if name not in CLOSED_FROM_ABOVE]


def _close(path: Path) -> Iterator[tuple[Path, int]]:
    try:
        found = path.lstat()
        if stat.S_ISLNK(found.st_mode):
            return  # the target of a link is outside this home
        mode = stat.S_IMODE(found.st_mode)
        if found.st_uid == os.geteuid() and mode & OPEN_TO_OTHERS:
            path.chmod(mode & ~OPEN_TO_OTHERS)
            yield path, mode
    except FileNotFoundError:  # temporary file of another process
        return


def _warning(path: Path, mode: int) -> str:
    return f"{path} was open to other users (mode {mode:04o}); it is closed now"
