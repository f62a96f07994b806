"""Settings of glibc's `malloc` for processes with many threads."""

from __future__ import annotations

import ctypes
import os
import sys

ARENA_MAX = -8
"""`M_ARENA_MAX` of malloc.h."""
SAID = ("MALLOC_ARENA_MAX", "GLIBC_TUNABLES")
"""Environment variables with which an operator overrides this."""


def one_heap() -> None:
    """Share one heap among all threads; for a server of many threads, before it starts them.

    glibc gives threads heaps of their own, eight per core. Memory allocated by one thread and freed by another
    leaves holes there, and each heap keeps the size of its largest request: a server with forty short-lived threads
    grows for hours without using the memory. Python threads hardly ever contend for a heap, since the interpreter's
    lock lets one run at a time. Other C libraries are unaffected.
    """
    if not sys.platform.startswith("linux") or any(name in os.environ for name in SAID):
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # musl has none
    if mallopt is not None:
        mallopt(ARENA_MAX, 1)
