"""Limit of torch's threads while a prompt is read."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

import torch


@contextmanager
def one_thread() -> Generator[None]:
    """Limit torch to one thread, as a context or a decorator: matrices of a sentence are too small to share, and on a
    busy machine threads that wait for each other cost twenty times the work (64 prompts: 2 s on one thread, 40 s on
    two)."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
