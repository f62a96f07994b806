"""Weights of a smaller transformer in a larger one that computes the same: a start for training on with more capacity.

New blocks and new columns of hidden layers write nothing at first, so the outputs stay as they were (the deepening and
widening of Chen et al. 2016, "Net2Net", for stacks whose norms come first).
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from marey.core.errors import InvalidInput

_WRITES = ("attention.out.weight", "attention.out.bias", "narrow.weight", "narrow.bias")
"""Matrices by which a block adds to its input; without them it passes the input on."""


def grow(small: Mapping[str, Tensor], large: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return weights for the larger network.

    Args:
        small: state dict of a trained network.
        large: state dict of a new network, which has more blocks or wider hidden layers in its blocks; its norms come
            before attention and hidden layer (`norm_first`).

    Raises:
        InvalidInput: the networks differ in something else, or the larger has fewer blocks.
    """
    if lost := sorted(small.keys() - large.keys()):
        raise InvalidInput(f"has no place for {lost[0]}", hint="A transformer can only grow.")
    return {name: _grown(name, small.get(name), new) for name, new in large.items()}


def _grown(name: str, old: Tensor | None, new: Tensor) -> Tensor:
    if old is None:
        if ".blocks." not in name:
            raise InvalidInput(f"{name} is not among the weights to grow from")
        return torch.zeros_like(new) if name.endswith(_WRITES) else new.clone()
    if old.shape == new.shape:
        return old.clone()
    grown = new.clone()
    if name.endswith(("wide.weight", "wide.bias")) and old.shape[1:] == new.shape[1:] and len(old) < len(new):
        grown[: len(old)] = old
        return grown
    if name.endswith("narrow.weight") and len(old) == len(new) and old.shape[1] < new.shape[1]:
        grown.zero_()
        grown[:, : old.shape[1]] = old
        return grown
    raise InvalidInput(
        f"{name} has the shape {tuple(new.shape)}, and {tuple(old.shape)} where it would grow from",
        hint="Only the number of blocks and the width of their hidden layers can grow.",
    )


@torch.no_grad()
def take(network: nn.Module, other: Mapping[str, Tensor], names: Mapping[str, str]) -> list[str]:
    """Copy those weights of another network that fit into `network` in place; its own blocks write nothing at first.

    Codebooks and statistics are not weights and stay as they are.

    Args:
        network: to be trained.
        other: state dict of a trained network, of another model perhaps.
        names: beginnings of names in `network`, and what `other` may call them.

    Returns:
        names of the weights that were copied; empty if none has a like of the same name and shape.
    """
    copied: list[str] = []
    for name, weight in network.named_parameters():
        value = other.get(name, other.get(_foreign(name, names)))
        if value is not None and value.shape == weight.shape:
            weight.copy_(value)
            copied.append(name)
    for name, weight in network.named_parameters():
        if copied and name not in copied and name.endswith(_WRITES):
            weight.zero_()
    return copied


def _foreign(name: str, names: Mapping[str, str]) -> str:
    for own, foreign in names.items():
        if name.startswith(own):
            return foreign + name.removeprefix(own)
    return name
