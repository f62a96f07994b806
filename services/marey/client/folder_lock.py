"""One fetch into a folder at a time: two would write the same `.part` files and lose lines of the manifest."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

from marey.core.errors import InvalidInput


@contextmanager
def alone_in(folder: Path, waiting: Callable[[], None] = lambda: None) -> Generator[None]:
    """Let no other fetch write into a folder while the block runs. The lock is that of the open folder: it leaves no
    file, and ends with the process. Where there is none (Windows, some network drives), nothing is kept out.

    Args:
        waiting: called if another fetch is at work; its end is awaited.

    Raises:
        InvalidInput: the folder cannot be opened.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise InvalidInput(f"cannot be read: {error.strerror}", where=str(folder)) from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            waiting()
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        except OSError:  # the drive has no locks
            pass
        yield
    finally:
        os.close(descriptor)
