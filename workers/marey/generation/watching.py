"""Progress and cancellation of a batch that is generated group by group, perhaps on several threads."""

from __future__ import annotations

import threading

import torch
from torch import Tensor

from marey.generation.port import GenerationControl


class Steps:
    """Step counter of all groups, which batch threads run in parallel; reports the progress."""

    def __init__(self, control: GenerationControl, total: int) -> None:
        """Count up to `total` steps."""
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


class Watcher:
    """Adapter from dropped requests to the rows of one group to keep."""

    def __init__(self, steps: Steps, rows: list[int]) -> None:
        """Watch the requests at `rows`."""
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
