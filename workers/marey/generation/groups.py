"""Groups of requests that share a forward pass, with one progress report and cancellations for all."""

from __future__ import annotations

import threading
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Self

import torch
from torch import Tensor

from marey.generation.port import GenerationControl

MAX_ROWS = 32
"""Items of a forward pass; a larger batch is no faster on a CPU and needs more memory."""
BUCKET = 8
"""Tokens; an item is padded to a multiple of this, not to the longest of its batch."""

KeepRows = Callable[[], Tensor | None]
"""Called after each pass of a group (`RowWatcher.step`): bool (B,) rows to go on with, or None for all."""


@dataclass(frozen=True)
class GroupItems:
    """Base class of the items of a group while they are decoded: tensors with a row an item."""

    def select(self, rows: Tensor) -> Self:
        """Return the items at `rows`."""
        return type(self)(**{each.name: getattr(self, each.name)[rows] for each in fields(self)})


def to_bucket(tokens: int) -> int:
    """Return the bucket of a length: its tokens rounded up to a multiple of BUCKET."""
    return -(-tokens // BUCKET) * BUCKET


def group_rows(buckets: Sequence[int], threads: int) -> list[list[int]]:
    """Group the rows of equal buckets, at most MAX_ROWS and no more than a thread's share; the largest buckets come
    first."""
    most = min(MAX_ROWS, -(-len(buckets) // threads))
    rows: dict[int, list[int]] = defaultdict(list)
    for row, bucket in enumerate(buckets):
        rows[bucket].append(row)
    return [each[i : i + most] for _, each in sorted(rows.items(), reverse=True) for i in range(0, len(each), most)]


class StepCounter:
    """Step counter of all groups, which batch threads run in parallel; reports the progress."""

    def __init__(self, control: GenerationControl, total: int) -> None:
        self._control = control
        self._total = total
        self._done = 0
        self._lock = threading.Lock()

    def step(self) -> set[int]:
        """Count one step; return the requests to leave out."""
        with self._lock:
            self._done = min(self._done + 1, self._total)
            self._control.progress(self._done, self._total)
            return self._control.dropped()

    def dropped(self) -> set[int]:
        """Return the requests to leave out."""
        with self._lock:
            return self._control.dropped()


class RowWatcher:
    """Adapter from dropped requests to the rows of one group to keep."""

    def __init__(self, steps: StepCounter, rows: list[int]) -> None:
        """`rows`: the group's requests."""
        self._steps = steps
        dropped = steps.dropped()
        self.rows = [r for r in rows if r not in dropped]

    def step(self) -> Tensor | None:
        """Count one step; return the rows to keep, or None for all."""
        dropped = self._steps.step()
        if not dropped or not any(r in dropped for r in self.rows):
            return None
        keep = [r not in dropped for r in self.rows]
        self.rows = [r for r in self.rows if r not in dropped]
        return torch.tensor(keep)
