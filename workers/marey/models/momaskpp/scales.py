"""Positions of the tokens of all scales, and resampling between a scale and the full one (eq. 5).

The tokens of a clip are one row: a block a scale, coarse to fine, and the block of scale s begins at the same position
for every clip. Positions that a clip does not have are NO_TOKEN.

Shapes: B batch, V scales, T tokens of the longest clip, P_v = T // s_v positions of block v, N = Σ P_v.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from marey.models.momaskpp.config import Layout, MoMaskPPConfig
from marey.nn.convolution import frame_mask


@dataclass(frozen=True)
class Scales:
    """The scales of a configuration."""

    divisors: tuple[int, ...]  # s_v
    layout: Layout
    longest: int  # T

    @classmethod
    def of(cls, config: MoMaskPPConfig) -> Scales:
        """Return the scales of a configuration."""
        return cls(config.tokenizer.scales, config.tokenizer.layout, config.max_tokens)

    @property
    def widths(self) -> tuple[int, ...]:
        """Return P_v of each block."""
        return tuple(max(1, self.longest // divisor) for divisor in self.divisors)

    @property
    def size(self) -> int:
        """Return N."""
        return sum(self.widths)

    def span(self, lengths: Tensor) -> Tensor:
        """Return the full-scale tokens (B,) that a block is spread over: T, or the clip's own n."""
        return torch.full_like(lengths, self.longest) if self.layout == "padded" else lengths

    def positions(self, lengths: Tensor, scale: int) -> Tensor:
        """Return the positions (B,) that a block is resampled to and from."""
        return (self.span(lengths) // self.divisors[scale]).clamp(min=1)

    def counts(self, lengths: Tensor, scale: int) -> Tensor:
        """Return the tokens (B,) of clips of `lengths` (B,) at a scale: n // s, and one at least unless padded."""
        own = lengths // self.divisors[scale]
        return own if self.layout == "padded" else own.clamp(min=1)

    def valid(self, lengths: Tensor) -> Tensor:
        """Return the positions that clips of `lengths` (B,) have, (B, N) bool."""
        blocks = [frame_mask(self.counts(lengths, scale), width) for scale, width in enumerate(self.widths)]
        return torch.cat(blocks, 1)

    def total(self, length: int) -> int:
        """Return the number of tokens, all scales together, of a clip of `length`."""
        return int(self.valid(torch.tensor([length])).sum())

    def within(self, chosen: Tensor) -> Tensor:
        """Return the positions (N,) of one clip that cover chosen full-scale tokens (n,) alone."""
        length = torch.tensor([len(chosen)], device=chosen.device)
        blocks: list[Tensor] = []
        for scale, width in enumerate(self.widths):
            covers = shrinking(self.span(length), self.positions(length, scale), self.longest, width)[0] > 0  # (P, T)
            others = torch.ones(self.longest, dtype=torch.bool, device=chosen.device)
            others[: len(chosen)] = ~chosen
            blocks.append(covers.any(1) & ~(covers & others).any(1))
        return torch.cat(blocks)

    def split(self, tokens: Tensor) -> tuple[Tensor, ...]:
        """Split tokens (B, N) into their blocks, each (B, P_v)."""
        return tokens.split(self.widths, 1)


def shrinking(span: Tensor, positions: Tensor, size: int, width: int) -> Tensor:
    """Return the matrices (B, width, size) of area interpolation from `span` (B,) tokens to `positions` (B,).

    Position i is the mean of the tokens ⌊i·n/h⌋ … ⌈(i+1)·n/h⌉ - 1 (adaptive average pooling); further rows are zero.
    """
    i = torch.arange(width, device=span.device)[None]  # (1, P)
    n, h = span[:, None], positions[:, None]
    first, end = i * n // h, -(-(i + 1) * n // h)  # (B, P)
    t = torch.arange(size, device=span.device)
    inside = (t >= first[..., None]) & (t < end[..., None]) & (i < h)[..., None]
    return inside / (end - first)[..., None]


def enlarging(span: Tensor, positions: Tensor, size: int, width: int) -> Tensor:
    """Return the matrices (B, size, width) of linear interpolation from `positions` (B,) to `span` (B,) tokens.

    Token t samples (t + ½)·h/n - ½, clamped at the ends (corners not aligned); further rows are zero.
    """
    t = torch.arange(size, device=span.device)[None]  # (1, T)
    n, h = span[:, None], positions[:, None]
    at = ((t + 0.5) * (h / n) - 0.5).clamp(min=0).minimum(h - 1)  # (B, T)
    i = torch.arange(width, device=span.device)
    weights = (1 - (at[..., None] - i).abs()).clamp(min=0)
    return weights * (t < n)[..., None]
