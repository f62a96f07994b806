"""Drawing tokens: counter-based random numbers, guidance, top-k.

A random number is a function of (seed, stream, step, position) only, so an item's tokens do not depend on the batch
it is decoded in. The hash is SplitMix64 (Steele, Lea and Flood 2014), applied to a counter.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

_GOLDEN = -7046029254386353131  # 0x9E3779B97F4A7C15 as a signed 64-bit integer
_MIX_1 = -4658895280553007687  # 0xBF58476D1CE4E5B9
_MIX_2 = -7723592293110705685  # 0x94D049BB133111EB


def uniform(seeds: Tensor, stream: int, step: int, positions: Tensor) -> Tensor:
    """Return uniform numbers in (0, 1), float32, for each (seed, position).

    Args:
        seeds: (B,) int64, one an item.
        stream: purpose of the numbers (base tokens, residual tokens, …).
        step: decoding step.
        positions: (n,) int64, or (B, n), its own for each seed.

    Returns:
        (B, n). Never 0 or 1.
    """
    key = _hash(_hash(seeds + _wrap(stream * _GOLDEN)) + _wrap(step * _GOLDEN))  # (B,)
    own = positions if positions.dim() == 2 else positions[None]
    bits = _hash(key[:, None] + (own + 1) * _GOLDEN)  # (B, n)
    top = _shift(bits, 41)  # 23 bits: with the half below exactly representable in float32
    return (top.float() + 0.5) * 2.0**-23


def guide(conditional: Tensor, unconditional: Tensor, scale: float) -> Tensor:
    """Classifier-free guidance on logits: u + s·(c − u)."""
    return unconditional + scale * (conditional - unconditional)


def sample_top_k(logits: Tensor, noise: Tensor, *, temperature: float, share: float) -> Tensor:
    """Draw one token per row by inverting the distribution function of softmax(top-k(logits / temperature)).

    Args:
        logits: (..., K) float32.
        noise: (...) uniform in (0, 1).
        temperature: > 0; 0 takes the likeliest.
        share: of the K codes that may be drawn, rounded up; 1 = all.

    Returns:
        (...) int64.
    """
    if temperature == 0:
        return logits.argmax(-1)
    keep = min(logits.shape[-1], max(1, math.ceil(share * logits.shape[-1] - 1e-9)))
    top, index = torch.topk(logits, keep, dim=-1, sorted=True)  # (..., k)
    cumulated = torch.softmax(top / temperature, -1).cumsum(-1)
    threshold = (noise * cumulated[..., -1])[..., None]  # the last sum is not exactly 1
    drawn = (cumulated < threshold).sum(-1, keepdim=True).clamp(max=keep - 1)
    return index.gather(-1, drawn).squeeze(-1)


def draw_class(logits: Tensor, seed: int, stream: int, *, middle: bool = False) -> int:
    """Draw one class by inverting the distribution function of softmax(logits) (1, N), with the number of `seed`.

    Args:
        middle: draw from the middle third of the distribution: seeds differ, without extremes.
    """
    share = torch.softmax(logits.float(), -1).cumsum(-1)  # (1, N)
    seeds = torch.tensor([seed], device=logits.device)
    draw = uniform(seeds, stream, 0, torch.zeros(1, dtype=torch.long, device=logits.device))
    return int((share < ((1 + draw) / 3 if middle else draw) * share[:, -1:]).sum())


def _hash(value: Tensor) -> Tensor:
    """Apply SplitMix64's finaliser to int64 (overflow wraps)."""
    value = (value ^ _shift(value, 30)) * _MIX_1
    value = (value ^ _shift(value, 27)) * _MIX_2
    return value ^ _shift(value, 31)


def _wrap(value: int) -> int:
    """Return a Python integer modulo 2^64, as signed 64 bits."""
    return (value + (1 << 63)) % (1 << 64) - (1 << 63)


def _shift(value: Tensor, bits: int) -> Tensor:
    """Shift int64 right logically (torch's shift is arithmetic)."""
    return (value >> bits) & ((1 << (64 - bits)) - 1)
