"""Masks for masked token modelling, in training (HGM³ Sec. 3.2) and in decoding (Sec. 3.4)."""

from __future__ import annotations

import math

import torch
from torch import Tensor


def cosine_schedule(progress: Tensor) -> Tensor:
    """Return γ(τ) = cos(πτ/2), the masked share (Chang et al. 2022)."""
    return torch.cos(progress * (math.pi / 2))


def mask_counts(progress: Tensor, lengths: Tensor) -> Tensor:
    """Return the number of masked tokens m = max(1, round(γ(τ)·n)) per sample, n its OWN length (ours).

    Counted on the padded length, as MoMask does, a short clip can lose every mask, or all of its tokens.

    Args:
        progress: τ (B,) in [0, 1].
        lengths: n (B,) >= 1.
    """
    return (cosine_schedule(progress) * lengths).round().long().clamp(min=1).minimum(lengths)


def easy_to_hard_mask(difficulty: Tensor, noise: Tensor, valid: Tensor, counts: Tensor, alpha: float) -> Tensor:
    """Choose the tokens to mask: the hardest ⌊α·m⌋ by `difficulty`, the rest at random among the others (eq. 8 ff.).

    Args:
        difficulty: (B, n) predicted losses (any scale).
        noise: (B, n) uniform random numbers; their order is the random choice.
        valid: (B, n) bool, tokens that exist.
        counts: m (B,), at most the number of valid tokens.
        alpha: α_t, share of hard tokens.

    Returns:
        (B, n) bool with exactly m true in each row, all of them valid.
    """
    hard_counts = torch.floor(alpha * counts + 1e-6).long()
    hard = _first(difficulty.masked_fill(~valid, -torch.inf), hard_counts)
    # Random priority among the rest: hard ones come before everything, invalid ones after.
    priority = noise.clamp(0, 1).masked_fill(hard, 2.0).masked_fill(~valid, -1.0)
    return _first(priority, counts)


def _first(score: Tensor, counts: Tensor) -> Tensor:
    """Mark the `counts` (B,) highest scores in each row of (B, n); ties go to the earlier position."""
    order = torch.argsort(score, dim=1, descending=True, stable=True)
    rank = torch.empty_like(order).scatter_(
        1, order, torch.arange(score.shape[1], device=score.device).expand_as(order)
    )
    return rank < counts[:, None]


def remaining_masks(length: int, steps: int, *, min_progress: bool = False) -> list[int]:
    """Return the masked tokens m_l left after each pass l = 1 … L of decoding a clip of `length` tokens (Sec. 3.4).

    m_l = min(⌈γ(l/L)·n − 1e-6⌉, m_{l−1}), m_L = 0 (cos(π/2) is not 0 in floating point).

    Args:
        length: n.
        steps: L.
        min_progress: keep at least one token in every pass (ours).
    """
    masked = length
    schedule: list[int] = []
    for step in range(1, steps + 1):
        target = math.ceil(math.cos(math.pi / 2 * step / steps) * length - 1e-6)
        if min_progress:
            target = min(target, masked - 1)
        masked = 0 if step == steps else max(0, min(target, masked))
        schedule.append(masked)
    return schedule
