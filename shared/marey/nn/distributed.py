"""The few collective operations training needs; every one is a no-op in a single process."""

from __future__ import annotations

from collections.abc import Iterable

import torch
import torch.distributed as dist
from torch import Tensor


def is_distributed() -> bool:
    """Return True if a process group of more than one process runs."""
    return dist.is_available() and dist.is_initialized() and dist.get_world_size() > 1


def rank() -> int:
    """Return this process's rank, 0 without a process group."""
    return dist.get_rank() if is_distributed() else 0


def all_reduce_sum(tensor: Tensor) -> Tensor:
    """Sum `tensor` over all processes, in place."""
    if is_distributed():
        dist.all_reduce(tensor)  # pyright: ignore[reportUnknownMemberType]
    return tensor


def broadcast(tensor: Tensor) -> Tensor:
    """Overwrite `tensor` with rank 0's, in place."""
    if is_distributed():
        dist.broadcast(tensor, src=0)
    return tensor


def broadcast_any(mine: Tensor | None, like: Tensor) -> Tensor | None:
    """Return the tensor of the first process that has one, the same everywhere; None if no process has any.

    Every process must call this, with `mine` of the shape and type of `like`, or None.
    """
    if not is_distributed():
        return mine
    has = torch.zeros(dist.get_world_size(), device=like.device)
    has[rank()] = float(mine is not None)
    owners = all_reduce_sum(has)
    if not bool(owners.any()):
        return None
    shared = torch.empty_like(like) if mine is None else mine
    dist.broadcast(shared, src=int(owners.argmax()))
    return shared


def barrier() -> None:
    """Wait for all processes."""
    if is_distributed():
        dist.barrier()  # pyright: ignore[reportUnknownMemberType]


def average_gradients(parameters: Iterable[torch.nn.Parameter]) -> None:
    """Average gradients over all processes in one collective (a parameter without one counts as zero)."""
    if not is_distributed():
        return
    owners = [p for p in parameters if p.requires_grad]
    for parameter in owners:
        if parameter.grad is None:
            parameter.grad = torch.zeros_like(parameter)
    gradients = [p.grad for p in owners if p.grad is not None]
    flat = torch.cat([g.reshape(-1) for g in gradients])
    dist.all_reduce(flat)  # pyright: ignore[reportUnknownMemberType]
    flat /= dist.get_world_size()
    offset = 0
    for gradient in gradients:
        gradient.copy_(flat[offset : offset + gradient.numel()].view_as(gradient))
        offset += gradient.numel()
