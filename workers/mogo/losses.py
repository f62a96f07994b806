"""What MOGO's two networks are trained on (eq. 6 and eq. 11)."""

from __future__ import annotations

from dataclasses import replace

import torch.nn.functional as F
from torch import Tensor

from shared.nn.quantizer import Quantized
from workers.mogo.config import MOGOConfig
from workers.mogo.model import NOT_ASKED
from workers.mogo.tokenizer import Tokenizer
from workers.training.tokenizing import TokenizerLoss, tokenizer_loss


def mosa_loss(
    model: Tokenizer, config: MOGOConfig, features: Tensor, lengths: Tensor | None = None, fraction: float = 1.0
) -> tuple[TokenizerLoss, Quantized]:
    """Eq. 6 plus HGM³'s terms on the joints (ours).

    Args:
        model: the tokenizer.
        config: weights of the terms.
        features: (B, T, D) in their own units.
        lengths: (B,) frames, or None where every window is full.
        fraction: of the budget used.
    """
    loss, quantized = tokenizer_loss(model, config, features, lengths, fraction)
    return replace(loss, total=loss.total + config.tokenizer.regularizer * model.quantizer.regularizer()), quantized


def sequence_loss(logits: Tensor, targets: Tensor) -> tuple[Tensor, Tensor]:
    """Eq. 11 as a mean over all codes asked for (ours: the sum would weigh clips by their length).

    Args:
        logits: (B, V, n + 1, K + 1).
        targets: (B, V, n + 1) from `next_targets`.

    Returns:
        the loss, and (V,) the mean of each level, without gradient.
    """
    losses = F.cross_entropy(logits.flatten(0, 2), targets.flatten(), ignore_index=NOT_ASKED, reduction="none").view(
        targets.shape
    )
    asked = targets != NOT_ASKED
    levels = losses.detach().sum((0, 2)) / asked.sum((0, 2)).clamp(min=1)
    return losses.sum() / asked.sum().clamp(min=1), levels
