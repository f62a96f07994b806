"""Threads that compute side by side, each with a part of a batch and one torch thread.

torch shares every single operation among its threads and makes them wait for each other behind it. At HGM³'s `paper`
size two threads then take 1.4 times the processor time of one, and a batch of one is no faster for the second. Parts
of a batch that know nothing of each other wait once, at their end.
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


class Lanes:
    """A number of threads for the parts of a batch; started when they are first needed.

    What runs in a lane is alone there: asked to split once more, it is given one part.
    """

    def __init__(self, count: int) -> None:
        """`count` lanes; 1 computes on the caller's thread, with torch's own threads."""
        self.count = count
        self._inside = threading.local()
        self._pool: ThreadPoolExecutor | None = None

    def __deepcopy__(self, memo: object) -> Lanes:
        """Itself: a copied network computes in the same lanes."""
        return self

    @contextmanager
    def open(self) -> Generator[None]:
        """While lanes compute, the caller has one torch thread as well: another would take a lane's processor."""
        if self.count == 1:
            yield
            return
        with one_thread():
            yield

    def parts(self, size: int) -> list[slice]:
        """`size` rows in equal parts, one a lane, none empty."""
        count = 1 if getattr(self._inside, "lane", False) else max(1, min(self.count, size))
        return [slice(size * i // count, size * (i + 1) // count) for i in range(count)]

    def map(self, function: Callable[[T], R], parts: Sequence[T]) -> list[R]:
        """`function` of every part, without gradients, in their order; a single part on the caller's thread.

        Raises:
            whatever `function` raises, when all parts are through.
        """
        if self.count == 1 or len(parts) == 1:
            return [function(part) for part in parts]
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self.count, "lane", initializer=self._enter)
        futures = [self._pool.submit(_infer, function, part) for part in parts]
        errors = [error for future in futures if (error := future.exception()) is not None]
        if errors:
            raise errors[0]
        return [future.result() for future in futures]

    def _enter(self) -> None:
        torch.set_num_threads(1)
        self._inside.lane = True


def _infer(function: Callable[[T], R], part: T) -> R:
    with torch.inference_mode():
        return function(part)


ONE_LANE = Lanes(1)
