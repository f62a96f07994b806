"""Steps replayed as CUDA graphs.

A frame is some hundred small kernels a layer of time spent in Python, and a GPU runs them faster than Python can start
them. Recorded once, they are started together. A graph has fixed shapes: one is recorded for each power of two of rows,
and rows that nobody sits in are computed along.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

WARM_CALLS = 3
"""Before a step is recorded: libraries choose and load their kernels in the first calls."""


def row_counts(capacity: int) -> list[int]:
    """Numbers of rows that steps are recorded for: powers of two up to `capacity`, and `capacity`."""
    powers = [2**k for k in range(capacity.bit_length()) if 2**k < capacity]
    return [*powers, capacity]


class Replayed:
    """A step, recorded when a number of rows is first asked for."""

    def __init__(self, step: Callable[[int], Tensor], capacity: int, device: torch.device) -> None:
        """Wrap a step.

        Args:
            step: from a number of rows to (rows, …); of tensors that stay where they are, without a look at a value,
                and with the same effect when it runs twice.
            capacity: rows at most.
            device: of the tensors.
        """
        self._step, self._counts, self._device = step, row_counts(capacity), device
        self._recorded: dict[int, tuple[torch.cuda.CUDAGraph, Tensor]] = {}
        self._pool = torch.cuda.graph_pool_handle()  # graphs that never run at once share what they compute in

    def __call__(self, rows: int) -> Tensor:
        """What the step gives for `rows` rows."""
        count = next(count for count in self._counts if count >= rows)
        if count not in self._recorded:
            self._recorded[count] = self._record(count)
        graph, result = self._recorded[count]
        graph.replay()
        return result[:rows].clone()  # the next replay overwrites it

    def prepare(self) -> None:
        """Record all steps now: each takes a good part of a second, which no session should wait for."""
        for count in self._counts:
            self(count)

    @torch.no_grad()
    def _record(self, count: int) -> tuple[torch.cuda.CUDAGraph, Tensor]:
        with torch.cuda.device(self._device):
            aside = torch.cuda.Stream()
            aside.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(aside):
                for _ in range(WARM_CALLS):
                    self._step(count)
            torch.cuda.current_stream().wait_stream(aside)
            graph = torch.cuda.CUDAGraph()
            # other threads of a worker may use the device meanwhile
            with torch.cuda.graph(graph, pool=self._pool, capture_error_mode="thread_local"):
                result = self._step(count)
        return graph, result
