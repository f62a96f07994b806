"""Threads that process parts of a batch in parallel, each with one torch thread.

torch shares every single operation among its threads and waits for all of them after each. At HGM³'s `paper` size two
threads then take 1.4 times the processor time of one, and a batch of one is no faster. Independent parts of a batch
wait once, at their end.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import torch

from marey.nn.threads import one_thread

T = TypeVar("T")
R = TypeVar("R")


class BatchThreads:
    """A pool of threads for the parts of a batch; started when first needed.

    Code that runs in a thread of the pool does not split again: `parts` gives it one part.
    """

    def __init__(self, count: int) -> None:
        """Create `count` threads; 1 computes on the caller's thread, with torch's own threads."""
        self.count = count
        self._inside = threading.local()
        self._pool: ThreadPoolExecutor | None = None

    @classmethod
    def on(cls, device: torch.device) -> BatchThreads:
        """Return the threads for networks on a device: of a CPU as many as torch has, else one."""
        return cls(torch.get_num_threads() if device.type == "cpu" else 1)

    def __deepcopy__(self, memo: object) -> BatchThreads:
        """Return itself: a copied network shares its threads."""
        return self

    @contextmanager
    def open(self) -> Generator[None]:
        """Limit the caller to one torch thread while the pool computes: another would take a pool thread's
        processor."""
        if self.count == 1:
            yield
            return
        with one_thread():
            yield

    def parts(self, size: int) -> list[slice]:
        """Split `size` rows into equal slices, one per thread, none empty."""
        count = 1 if getattr(self._inside, "active", False) else max(1, min(self.count, size))
        return [slice(size * i // count, size * (i + 1) // count) for i in range(count)]

    def map(self, function: Callable[[T], R], parts: Sequence[T]) -> list[R]:
        """Apply `function` to every part without gradients; results in order. A single part runs on the caller's
        thread.

        Raises:
            the first error of `function`, after all parts have ended.
        """
        if self.count == 1 or len(parts) == 1:
            return [function(part) for part in parts]
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count, "batch", initializer=self._start_thread)
        futures = [self._pool.submit(_infer, function, part) for part in parts]
        errors = [error for future in futures if (error := future.exception()) is not None]
        if errors:
            raise errors[0]
        return [future.result() for future in futures]

    def _start_thread(self) -> None:
        torch.set_num_threads(1)
        self._inside.active = True


def _infer(function: Callable[[T], R], part: T) -> R:
    with torch.inference_mode():
        return function(part)


CALLING_THREAD = BatchThreads(1)
