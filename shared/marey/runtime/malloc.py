"""Settings of glibc's `malloc` for processes with many threads."""

from __future__ import annotations

import ctypes
import os
import sys

ARENA_MAX = -8
"""`M_ARENA_MAX` of malloc.h."""
SAID = ("MALLOC_ARENA_MAX", "GLIBC_TUNABLES")
"""Environment variables by which an operator says otherwise."""


def one_heap() -> None:
    """Share one heap among all threads; for a server of many threads, before it starts them.

    glibc gives threads heaps of their own, eight for each core. What one thread made and another let go of leaves holes
    there, and each heap keeps what its largest request once took: a server with forty threads that come and go grows
    for hours, though nothing of it is in use. Threads of Python hardly ever wait for each other there, for the
    interpreter's lock lets one run at a time. Other C libraries are left as they are.
    """
    if not sys.platform.startswith("linux") or any(name in os.environ for name in SAID):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
    if mallopt is not None:
        mallopt(ARENA_MAX, 1)
