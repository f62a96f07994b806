"""The decoding loops of MoMask (Sec. 3.4): base tokens by confidence, then residual levels.

As the public code decodes, with two differences (ours): each item draws with random numbers of its own seed, so its
tokens do not depend on the others of its batch; and a draw inverts the distribution function, which follows the same
law as the public Gumbel and categorical draws.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from marey.generation.groups import GroupItems, KeepRows
from marey.models.momask.config import InferenceConfig
from marey.models.momask.model import MaskedTransformer, ResidualTransformer, SentenceProjection
from marey.nn.convolution import frame_mask
from marey.nn.masking import cosine_schedule
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import sample_top_k, uniform

BASE_STREAM, RESIDUAL_STREAM, LENGTH_STREAM = 1, 2, 3
"""Streams of random numbers; see `marey.nn.sampling.uniform`."""


@dataclass(frozen=True)
class Items(GroupItems):
    """The items of one bucket."""

    lengths: Tensor  # (B,) own tokens n
    seeds: Tensor  # (B,) int64
    masked_sentence: Tensor  # (B, w) condition of the masked transformer
    residual_sentence: Tensor  # (B, w') condition of the residual transformer
    tokens: Tensor  # (B, n_bucket, V) int64, NO_TOKEN where not decoded


def masked_counts(lengths: Sequence[int], steps: int) -> Tensor:
    """Return the number of masked tokens of each pass (L, B): round(cos(πt/2)·n), at least 1, t = 0 … 1 in L steps.

    All tokens are masked in the first pass, one in the last. In float32 and on the CPU on every device: cos(π/3)·n of
    an odd n lies half way between two numbers.
    """
    share = cosine_schedule(torch.linspace(0, 1, steps, device="cpu"))
    return torch.round(share[:, None] * torch.tensor(lengths, device="cpu")).long().clamp(min=1)


def decode_base(model: MaskedTransformer, items: Items, config: InferenceConfig, keep: KeepRows) -> Items:
    """Fill `tokens[..., 0]`: each pass draws the masked tokens, and masks the least confident of them again."""
    size = items.tokens.shape[1]
    counts = masked_counts(items.lengths.tolist(), config.steps).to(items.lengths.device)
    base = torch.full_like(items.tokens[..., 0], model.mask_token)  # (B, n)
    confidence = torch.zeros(base.shape, device=base.device).masked_fill(
        ~frame_mask(items.lengths, size), math.inf
    )  # (B, n)
    for step in range(config.steps):
        if not len(base):
            break
        base, confidence = _base_pass(model, items, base, confidence, counts[step], step, config)
        stay = keep()
        if stay is not None:
            items, base, confidence, counts = items.select(stay), base[stay], confidence[stay], counts[:, stay]
    tokens = items.tokens.clone()
    tokens[..., 0] = base.masked_fill(~frame_mask(items.lengths, size), NO_TOKEN)
    return replace(items, tokens=tokens)


def _base_pass(
    model: MaskedTransformer,
    items: Items,
    base: Tensor,
    confidence: Tensor,
    count: Tensor,
    step: int,
    config: InferenceConfig,
) -> tuple[Tensor, Tensor]:
    """Draw the `count` (B,) least confident tokens anew; return tokens and confidences, both (B, n).

    Confidence is the guided softmax before temperature and top-k, and infinite for tokens that stay from now on.
    """
    size = base.shape[1]
    place = torch.arange(size, device=base.device)
    order = confidence.argsort(dim=1, stable=True)  # ties go to the earlier token
    rank = torch.empty_like(order).scatter_(1, order, place.expand_as(order))
    masked = rank < count[:, None]
    shown = base.masked_fill(masked, model.mask_token)
    logits = _base_logits(model, items, shown, config.guidance)  # (B, n, K)
    noise = uniform(items.seeds, BASE_STREAM, step, place)
    drawn = sample_top_k(logits, noise, temperature=config.temperature, share=config.top_k)  # (B, n)
    chance = logits.softmax(-1).gather(-1, drawn[..., None]).squeeze(-1)
    return torch.where(masked, drawn, shown), chance.masked_fill(~masked, math.inf)


def _base_logits(model: MaskedTransformer, items: Items, tokens: Tensor, guidance: float) -> Tensor:
    """Return guided logits (B, n, K), from one forward pass of 2 B sequences."""
    valid = frame_mask(items.lengths, tokens.shape[1])
    if guidance == 1:
        return model(tokens, valid, items.masked_sentence)
    both = _with_null(model.condition, items.masked_sentence)
    return model(tokens.repeat(2, 1), valid.repeat(2, 1), both, guidance)


def decode_residual(model: ResidualTransformer, items: Items, config: InferenceConfig, keep: KeepRows) -> Items:
    """Fill `tokens[..., 1:]` level by level. A drawn padding token adds nothing: NO_TOKEN."""
    total: Tensor | None = None
    for level in range(1, model.levels):
        if not len(items.lengths):
            break
        valid = frame_mask(items.lengths, items.tokens.shape[1])
        below = items.tokens[..., level - 1]
        embedded = model.embed(below.masked_fill(below == NO_TOKEN, model.pad_token), level - 1)
        total = embedded if total is None else total + embedded
        logits = _residual_logits(model, items, total, valid, level, config.residual_guidance)
        noise = uniform(items.seeds, RESIDUAL_STREAM, level, torch.arange(valid.shape[1], device=valid.device))
        drawn = sample_top_k(
            logits, noise, temperature=config.residual_temperature, share=config.residual_top_k
        )  # (B, n)
        tokens = items.tokens.clone()
        tokens[..., level] = drawn.masked_fill(~valid | (drawn == model.pad_token), NO_TOKEN)
        items = replace(items, tokens=tokens)
        stay = keep()
        if stay is not None:
            items, total = items.select(stay), total[stay]
    return items


def _residual_logits(
    model: ResidualTransformer, items: Items, total: Tensor, valid: Tensor, level: int, guidance: float
) -> Tensor:
    """Return guided logits (B, n, K + 1), from one forward pass of 2 B sequences."""
    if guidance == 1:
        return model(total, valid, level, items.residual_sentence)
    both = _with_null(model.condition, items.residual_sentence)
    return model(total.repeat(2, 1, 1), valid.repeat(2, 1), level, both, guidance)


def _with_null(condition: SentenceProjection, sentence: Tensor) -> Tensor:
    """Return conditions (2 B, w): those of the items, then none for each."""
    return torch.cat([sentence, condition.null().expand_as(sentence)])
