"""Memory in use, as torch's allocator counts it."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager

import numpy as np
import torch
from torch import Tensor, nn

Peak = Callable[[Callable[[], nn.Module], Callable[[nn.Module], Iterable[Tensor]]], int]
"""Measures a peak, as `peak_of_steps` does."""


def peak_of_steps(
    build: Callable[[], nn.Module], parts: Callable[[nn.Module], Iterable[Tensor]], *, bf16: bool = False
) -> int:
    """Largest number of bytes in use during two steps of training (AdamW) on a CPU; with `bf16`, matrices are in
    bfloat16.

    Args:
        build: makes all networks; their weights count.
        parts: yields the losses of the parts of a step, each of which is freed before the next.
    """
    gc.collect()  # memory of earlier tests that is freed inside would count as less
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU], profile_memory=True) as profile:
        _train(build(), parts, lambda: torch.autocast("cpu", torch.bfloat16, enabled=bf16))
    events = profile.profiler.kineto_results.events()  # type: ignore[union-attr]
    changes = sorted((e.start_ns(), e.nbytes()) for e in events if e.name() == "[memory]")  # pyright: ignore[reportAttributeAccessIssue]
    return max(np.cumsum([change for _, change in changes]))


def peak_on_gpu(build: Callable[[], nn.Module], parts: Callable[[nn.Module], Iterable[Tensor]]) -> int:
    """The same on a CUDA device, with matrices in bfloat16; networks and samples are made there."""
    torch.cuda.empty_cache()
    before = torch.cuda.memory_allocated()
    torch.cuda.reset_peak_memory_stats()
    with torch.device("cuda"):
        _train(build(), parts, lambda: torch.autocast("cuda", torch.bfloat16))
    return torch.cuda.max_memory_allocated() - before


def _train(
    module: nn.Module,
    parts: Callable[[nn.Module], Iterable[Tensor]],
    forward: Callable[[], AbstractContextManager[object]],
) -> None:
    """Take two steps; each forward pass runs in a context of its own."""
    trained = [each for each in module.parameters() if each.requires_grad]
    optimizer = torch.optim.AdamW(trained, fused=True)
    for _ in range(2):
        losses = iter(parts(module))
        while True:
            with forward():
                loss = next(losses, None)
            if loss is None:
                break
            loss.backward()
            del loss
        optimizer.step()
        optimizer.zero_grad(set_to_none=True)
