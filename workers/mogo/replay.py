"""Steps replayed as CUDA graphs.

A frame is hundreds of small kernels, and a GPU runs them faster than Python can start them. Recorded once, they are
started together. A graph has one shape, so a step is always of all rows, and those that nobody sits in are computed
along: then what a session draws does not depend on how many there are, either.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

WARM_CALLS = 3
"""Before a step is recorded: libraries choose and load their kernels in the first calls."""


class Replayed:
    """A step, recorded when it is first asked for."""

    def __init__(self, step: Callable[[int], Tensor], rows: int, device: torch.device) -> None:
        """Wrap a step.

        Args:
            step: from a number of rows to (rows, …); of tensors that stay where they are, without a look at a value,
                and with the same effect when it runs twice.
            rows: of every step.
            device: of the tensors.
        """
        self._step, self._rows, self._device = step, rows, device
        self._recorded: tuple[torch.cuda.CUDAGraph, Tensor] | None = None

    def __call__(self, rows: int) -> Tensor:
        """What the step gives for the first `rows` rows."""
        self.prepare()
        assert self._recorded is not None
        graph, result = self._recorded
        graph.replay()
        return result[:rows].clone()  # the next replay overwrites it

    def prepare(self) -> None:
        """Record the step now: it takes a good part of a second, which no session should wait for."""
        if self._recorded is None:
            self._recorded = self._record()

    @torch.no_grad()
    def _record(self) -> tuple[torch.cuda.CUDAGraph, Tensor]:
        with torch.cuda.device(self._device):
            aside = torch.cuda.Stream()
            aside.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(aside):
                for _ in range(WARM_CALLS):
                    self._step(self._rows)
            torch.cuda.current_stream().wait_stream(aside)
            graph = torch.cuda.CUDAGraph()
            # cuBLAS keeps its workspace for each stream: no graph may use one that goes when another graph does
            torch._C._cuda_clearCublasWorkspaces()
            # other threads of a worker may use the device meanwhile
            with torch.cuda.graph(graph, stream=aside, capture_error_mode="thread_local"):
                result = self._step(self._rows)
            torch._C._cuda_clearCublasWorkspaces()
        return graph, result
