"""Steps replayed as CUDA graphs.

A frame is hundreds of small kernels, and a GPU runs them faster than Python starts them. A recorded graph starts them
all at once. A graph has one shape, so a step always computes all rows, unused ones included: a session's tokens then
do not depend on the number of sessions either.
"""

from __future__ import annotations

from collections.abc import Callable

import structlog
import torch
from torch import Tensor

log = structlog.get_logger()

WARM_CALLS = 3
"""Calls before a step is recorded: libraries choose and load their kernels in the first calls."""


class Replayed:
    """A step that is recorded at its first call. Where CUDA refuses, the log says so and the step runs unrecorded: the
    same frames, several times slower."""

    def __init__(self, step: Callable[[int], Tensor], rows: int, device: torch.device) -> None:
        """Wrap a step.

        Args:
            step: function of a number of rows, returns (rows, …); its tensors stay in place, it reads no value, and
                running it twice has the same effect.
            rows: of every step.
            device: of the tensors.
        """
        self._step, self._rows, self._device = step, rows, device
        self._recorded: tuple[torch.cuda.CUDAGraph, Tensor] | None = None
        self._refused = False

    def __call__(self, rows: int) -> Tensor:
        """Run the step and return its result for the first `rows` rows."""
        self.prepare()
        if self._recorded is None:
            return self._step(self._rows)[:rows]
        graph, result = self._recorded
        graph.replay()
        return result[:rows].clone()  # the next replay overwrites it

    def prepare(self) -> None:
        """Record the step now: it takes most of a second, which would delay a session.

        Raises:
            torch.OutOfMemoryError: not enough device memory.
        """
        if self._recorded is not None or self._refused:
            return
        try:
            self._recorded = self._record()
        except torch.OutOfMemoryError:
            raise
        except RuntimeError as error:
            self._refused = True
            log.error("a step could not be recorded: frames will be slow", device=str(self._device), error=str(error))

    @torch.no_grad()
    def _record(self) -> tuple[torch.cuda.CUDAGraph, Tensor]:
        with torch.cuda.device(self._device), torch.cuda.stream(torch.cuda.current_stream(self._device)):
            # the outer stream is the current one again, also where recording failed
            aside = torch.cuda.Stream()
            aside.wait_stream(torch.cuda.current_stream())
            with torch.cuda.stream(aside):
                for _ in range(WARM_CALLS):
                    self._step(self._rows)
            torch.cuda.current_stream().wait_stream(aside)
            graph = torch.cuda.CUDAGraph()
            # cuBLAS keeps one workspace per stream: a graph must not use one that is freed with another graph
            torch._C._cuda_clearCublasWorkspaces()
            # other threads of a worker may use the device meanwhile
            with torch.cuda.graph(graph, stream=aside, capture_error_mode="thread_local"):
                result = self._step(self._rows)
            torch._C._cuda_clearCublasWorkspaces()
        return graph, result
