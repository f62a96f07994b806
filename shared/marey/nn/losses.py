"""Losses of masked token modelling with hard token mining (HGM³ Sec. 3.2)."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor


def token_losses(logits: Tensor, targets: Tensor) -> Tensor:
    """Return ℓ_k = −log F(y_k | ·), eq. 3: (B, n, K) logits and (B, n) tokens to (B, n); float32."""
    losses = F.cross_entropy(logits.float().flatten(0, 1), targets.flatten().clamp(min=0), reduction="none")
    return losses.view(targets.shape)


def hits(logits: Tensor, targets: Tensor) -> Tensor:
    """Return the chance that a target is the likeliest token, ties in random order: (…, K) and (…) to (…), float32.

    In bfloat16, as under autocast, logits near 8 are 0.06 apart: several share the first place, and `argmax` would
    count the lowest code alone.
    """
    first = logits == logits.amax(-1, keepdim=True)
    tied = first.sum(-1, dtype=torch.int32)  # in int64 the copy that is summed is twice as large as the logits
    return first.gather(-1, targets.clamp(min=0)[..., None]).squeeze(-1) / tied


def ranking_loss(predicted: Tensor, losses: Tensor, masked: Tensor) -> Tensor:
    """Return eq. 5 as a mean over ordered pairs (ours: the sum would weigh a clip by the square of its masked tokens).

    For i ≠ j both masked, with 1_ij = [ℓ_i > ℓ_j]: −1_ij·log σ(l̂_i − l̂_j) − (1 − 1_ij)·log(1 − σ(l̂_i − l̂_j)).

    Args:
        predicted: l̂ (B, n).
        losses: ℓ (B, n); no gradient flows into them.
        masked: (B, n) bool.

    Returns:
        (B,), 0 where fewer than two tokens are masked.
    """
    losses = losses.detach()
    predicted = predicted.float()
    difference = predicted[:, :, None] - predicted[:, None, :]  # (B, n, n)
    harder = (losses[:, :, None] > losses[:, None, :]).to(difference.dtype)
    pair = F.binary_cross_entropy_with_logits(difference, harder, reduction="none")
    both = masked[:, :, None] & masked[:, None, :]
    both = both & ~torch.eye(masked.shape[1], dtype=torch.bool, device=masked.device)
    return (pair * both).sum((1, 2)) / both.sum((1, 2)).clamp(min=1)
