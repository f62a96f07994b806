"""A limit of memory for processes that read what others wrote."""

from __future__ import annotations

import resource
from contextlib import suppress
from pathlib import Path


def limit_memory(size: int, *, more: bool = False) -> None:
    """Bound the bytes of memory that this process may hold, for good; beyond, allocations fail.

    Memory that can be written counts, as Linux has it. Address space is no measure: libraries reserve far more of it
    than they use, Pixar's 384 MiB for the first property of a file, and crash where they do not get it.

    Args:
        size: bytes.
        more: beside what the process holds now.
    """
    with suppress(OSError, ValueError):  # macOS has no such limit; a lower one may stand already
        held = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[5]) * resource.getpagesize()
        most = size + held * more
        resource.setrlimit(resource.RLIMIT_DATA, (most, most))
