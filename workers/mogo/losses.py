"""What MOGO's networks are trained on beside what all tokenizers are (eq. 6 and eq. 11)."""

from __future__ import annotations

import torch.nn.functional as F
from torch import Tensor

from workers.mogo.config import TokenizerConfig
from workers.mogo.model import NOT_ASKED
from workers.mogo.tokenizer import Tokenizer


def scale_penalty(model: Tokenizer, config: TokenizerConfig) -> Tensor:
    """The last term of eq. 6: what holds scales at one and biases at zero; added to `tokenizer_loss`."""
    return config.regularizer * model.quantizer.regularizer()


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
