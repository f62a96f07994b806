"""When Python collects garbage: not while it imports, and not when a process ends."""

from __future__ import annotations

import atexit
import gc
from collections.abc import Generator
from contextlib import contextmanager


@contextmanager
def no_collection() -> Generator[None]:
    """Collect no garbage in the block, which imports or loads: what it creates stays, and each collection would look
    at all of it. Blocks may overlap in several threads."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def end_without_collection() -> None:
    """Let this process end without a last collection, which takes as long as many imports. What `atexit` and
    `weakref.finalize` call still runs."""
    atexit.register(gc.freeze)
