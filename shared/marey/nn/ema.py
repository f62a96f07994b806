"""Exponential moving averages of weights: the shipped model, and the teacher of hard token mining (HGM³ eq. 6)."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager

import torch
from torch import Tensor, nn

from marey.nn.stored_names import load_stored, stored_parameters


def warm_momentum(momentum: float, updates: int) -> float:
    """Return λ_k = min(λ, (1 + k) / (10 + k)): an average that starts late is not dominated by random weights."""
    return min(momentum, (1 + updates) / (10 + updates))


@torch.no_grad()
def update_average(average: nn.Module, source: nn.Module, momentum: float) -> None:
    """Update average <- λ·average + (1 - λ)·source for parameters; buffers are copied (eq. 6)."""
    for mine, theirs in zip(average.parameters(), source.parameters(), strict=True):
        mine.lerp_(theirs, 1 - momentum)
    for mine, theirs in zip(average.buffers(), source.buffers(), strict=True):
        mine.copy_(theirs)


class WeightAverage:
    """Moving average of a module's trainable parameters, swapped in for validation and shipping."""

    def __init__(self, module: nn.Module, momentum: float) -> None:
        """`momentum` 0 keeps no average: the weights themselves are used."""
        self.module = module
        self.momentum = momentum
        self.values: dict[str, Tensor] = {n: p.detach().clone() for n, p in self._parameters()} if momentum else {}

    def update(self, updates: int) -> None:
        """Move the average after step number `updates`."""
        self.blend(1 - warm_momentum(self.momentum, updates))

    @torch.no_grad()
    def blend(self, weight: float | Tensor) -> None:
        """Move the average towards the parameters by `weight`, 0 to 1; nothing where no average is kept."""
        for name, parameter in self._parameters() if self.momentum else ():
            self.values[name].lerp_(parameter, weight)

    @contextmanager
    def applied(self) -> Generator[None]:
        """Put the averaged weights into the module inside the block."""
        saved = {n: p.detach().clone() for n, p in self._parameters()}
        self._assign(self.values)
        try:
            yield
        finally:
            self._assign(saved)

    def assign(self) -> None:
        """Put the averaged weights into the module permanently."""
        self._assign(self.values)

    def load(self, values: dict[str, Tensor]) -> None:
        """Restore from a checkpoint."""
        for name in self.values:
            self.values[name].copy_(load_stored(values, name))

    def _parameters(self) -> list[tuple[str, nn.Parameter]]:
        return stored_parameters(self.module)

    @torch.no_grad()
    def _assign(self, values: dict[str, Tensor]) -> None:
        for name, parameter in self._parameters():
            if name in values:
                parameter.copy_(values[name])
