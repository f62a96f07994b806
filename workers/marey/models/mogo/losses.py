"""Losses of MOGO's networks beyond those that all tokenizers share (eq. 6 and eq. 11)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor

from marey.models.mogo.config import TokenizerConfig
from marey.models.mogo.model import NOT_ASKED, RQHCTransformer
from marey.models.mogo.tokenizer import Tokenizer
from marey.nn.losses import hits


def scale_penalty(model: Tokenizer, config: TokenizerConfig) -> Tensor:
    """Return the last term of eq. 6, which keeps scales near one and biases near zero; added to `tokenizer_loss`."""
    return config.regularizer * model.quantizer.regularizer()


@dataclass(frozen=True)
class LevelSums:
    """Sums over all predicted codes, per level: all (V,)."""

    losses: Tensor  # cross-entropies
    right: Tensor  # codes predicted correctly, a tie by its chance
    asked: Tensor  # codes predicted

    def __add__(self, other: LevelSums) -> LevelSums:
        """Add two sums."""
        return LevelSums(self.losses + other.losses, self.right + other.right, self.asked + other.asked)

    @property
    def means(self) -> Tensor:
        """Return (V,), the mean cross-entropy of a code."""
        return self.losses / self.asked.clamp(min=1)

    def loss(self, first_level: float) -> Tensor:
        """Return eq. 11 as a mean over codes (ours: its sum would weigh clips by their length), `first_level` times the
        weight on level 0."""
        weights = torch.ones_like(self.losses)
        weights[0].fill_(first_level)  # an assignment would copy the number from the host
        return (weights * self.means).sum() / weights.sum()


def level_sums(model: RQHCTransformer, states: Tensor, targets: Tensor, share: float = 1.0) -> LevelSums:
    """Sum how well states predict codes.

    Args:
        model: the transformer.
        states: (B, n, L, w) from `RQHCTransformer.states`.
        targets: (B, V, n) from `next_targets`.
        share: of the frames whose loss covers all levels, drawn at random; the others cover level 0 alone (ours).
            Without a depth head less than 1 saves nothing.
    """
    targets, states = targets.transpose(1, 2).flatten(0, 1), states.flatten(0, 1)
    drawn, others = _split(len(targets), share, targets.device)
    codes = targets[drawn]
    below = codes[:, :-1].masked_fill(codes[:, :-1] == model.end, NOT_ASKED)  # END is never an input
    sums = _sums(model.score(model.refine(states[drawn], below)), codes)
    if not len(others):
        return sums
    first = model.score(model.refine(states[others][:, :1], codes.new_empty(len(others), 0)))
    alone, padding = _sums(first, targets[others][:, :1]), (0, model.levels - 1)
    return sums + LevelSums(F.pad(alone.losses, padding), F.pad(alone.right, padding), F.pad(alone.asked, padding))


def ahead_loss(model: RQHCTransformer, states: Tensor, targets: Tensor, seam: Tensor | None, share: float) -> Tensor:
    """Return the cross-entropy of level 0 further ahead (`MOGOConfig.ahead`), a mean over targets; 0 without any.

    Args:
        model: the transformer.
        states: (B, n, L, w) from `RQHCTransformer.states`.
        targets: (B, V, n) from `next_targets`.
        seam: (B,) as in `states`: frames after a steer are not predictable before it.
        share: of the frames to predict, drawn at random.
    """
    losses: list[Tensor] = []
    size, position = states.shape[1], torch.arange(states.shape[1], device=states.device)
    for distance, project in zip(model.config.ahead, model.ahead, strict=True):
        wanted = targets[:, 0, distance:]
        now = position[: max(size - distance, 0)]
        asked = (wanted != NOT_ASKED) & (wanted != model.end)
        if seam is not None:
            asked &= (now >= seam[:, None]) | (now + distance < seam[:, None])
        drawn, _ = _split(wanted.numel(), share, wanted.device)
        codes = wanted.masked_fill(~asked, NOT_ASKED).flatten()[drawn]
        logits = model.score(project(states[:, : len(now), 0].flatten(0, 1)[drawn])[:, None])[:, 0]
        loss = F.cross_entropy(logits, codes, ignore_index=NOT_ASKED, reduction="sum")
        losses.append(loss / (codes != NOT_ASKED).sum().clamp(min=1))
    return torch.stack(losses).mean() if losses else states.new_zeros(())


def _split(rows: int, share: float, device: torch.device) -> tuple[Tensor, Tensor]:
    """Return a `share` of so many rows, drawn at random, and the others; all in their order where the share is 1."""
    every = torch.arange(rows, device=device) if share >= 1 else torch.rand(rows, device=device).argsort()
    count = round(min(share, 1.0) * rows)  # known on the host: steps are recorded on a GPU
    return every[:count], every[count:]


def _sums(logits: Tensor, codes: Tensor) -> LevelSums:
    """Sum over logits (N, m, K + 1) and codes (N, m), m levels; those that are NOT_ASKED do not count."""
    asked = codes != NOT_ASKED
    losses = F.cross_entropy(logits.flatten(0, 1), codes.flatten(), ignore_index=NOT_ASKED, reduction="none")
    right = (hits(logits.detach(), codes) * asked).sum(0)
    return LevelSums(losses.view(codes.shape).sum(0), right, asked.sum(0).to(right.dtype))
