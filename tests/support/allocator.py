"""Memory in use, as torch's allocator counts it."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import torch
from torch import Tensor, nn


def peak_of_steps(build: Callable[[], nn.Module], parts: Callable[[nn.Module], Iterable[Tensor]]) -> int:
    """Largest number of bytes in use during two steps of training (AdamW) on a CPU.

    Args:
        build: makes all networks; their weights count.
        parts: yields the losses of the parts of a step, each of which is freed before the next.
    """
    with torch.profiler.profile(activities=[torch.profiler.ProfilerActivity.CPU], profile_memory=True) as profile:
        module = build()
        trained = [each for each in module.parameters() if each.requires_grad]
        optimizer = torch.optim.AdamW(trained, fused=True)
        for _ in range(2):
            for loss in parts(module):
                loss.backward()
                del loss
            optimizer.step()
            optimizer.zero_grad(set_to_none=True)
    events = profile.profiler.kineto_results.events()  # type: ignore[union-attr]
    changes = sorted((e.start_ns(), e.nbytes()) for e in events if e.name() == "[memory]")  # pyright: ignore[reportAttributeAccessIssue]
    return max(np.cumsum([change for _, change in changes]))
