"""Work that is done over and over beside a test."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager


@contextmanager
def repeating(work: Callable[[], object], seconds: float = 0.05) -> Generator[None]:
    """Call a function in a thread every few moments until the end of the block."""
    ended = threading.Event()

    def repeat() -> None:
        while not ended.wait(seconds):
            work()

    thread = threading.Thread(target=repeat)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
