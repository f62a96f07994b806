"""The decoding loop of MoMask++ (Sec. 4.2.2): tokens of all scales at once, by confidence.

An item's tokens depend on its own seed, text, length and kept tokens alone. A forward holds items of one bucket, all
with the same positions, and both branches of guidance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from marey.generation.groups import GroupItems, KeepRows, to_bucket
from marey.models.momaskpp.config import InferenceConfig
from marey.models.momaskpp.model import ScaleTransformer
from marey.models.momaskpp.scales import Scales
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import sample_top_k, uniform

TOKEN_STREAM, LENGTH_STREAM = 1, 2
"""Streams of random numbers; see `marey.nn.sampling.uniform`."""


@dataclass(frozen=True)
class ScaleItems(GroupItems):
    """The items of one bucket, at S of the N positions."""

    lengths: Tensor  # (B,) own tokens n of the full scale
    seeds: Tensor  # (B,) int64
    words: Tensor  # (B, L, w) condition tokens
    null: Tensor  # (B, L, w) condition tokens without condition
    present: Tensor  # (B, L) bool
    tokens: Tensor  # (B, N) int64, NO_TOKEN where not decoded
    kept: Tensor  # (B, N) bool: tokens that stay as they are


def remaining_counts(total: int, steps: int) -> list[int]:
    """Return the masked tokens before each pass, and 0 at the end: round(cos(πt/2)·n), t = 0 … 1, at least one.

    The published schedule; it ends with a pass for the last token, where the paper's is one step ahead.

    Args:
        total: n, tokens to decode, all scales together.
        steps: L.
    """
    times = [i / max(1, steps - 1) for i in range(steps)]
    return [*(min(total, max(1, round(math.cos(math.pi / 2 * t) * total))) for t in times), 0]


def decode(
    model: ScaleTransformer, items: ScaleItems, scales: Scales, config: InferenceConfig, keep: KeepRows
) -> ScaleItems:
    """Fill `tokens` at the positions that the items have: L passes, each masks the least confident tokens anew.

    Args:
        model: the transformer.
        items: of one bucket.
        scales: of the bundle.
        config: passes, guidance, temperature, top-k.
        keep: called after each pass.
    """
    columns = _positions(items, scales)  # (S,)
    valid = scales.valid(items.lengths)[:, columns]  # (B, S)
    tokens = items.tokens[:, columns].masked_fill(~items.kept[:, columns], model.mask_token)
    open_counts = (valid & (tokens == model.mask_token)).sum(1).tolist()
    schedule = torch.tensor([remaining_counts(n, config.steps) for n in open_counts], device=valid.device).T
    for step in range(config.steps):
        before, after = schedule[step], schedule[step + 1]
        rows = (after < before).nonzero().squeeze(1)  # a pass that keeps no token changes nothing
        if len(rows):
            some = items.select(rows)
            tokens[rows] = _pass(model, some, tokens[rows], valid[rows], columns, after[rows], step, config)
        stay = keep()
        if stay is not None:
            items, tokens, valid, schedule = items.select(stay), tokens[stay], valid[stay], schedule[:, stay]
    filled = torch.full_like(items.tokens, NO_TOKEN)
    filled[:, columns] = tokens.masked_fill(~valid, NO_TOKEN)
    return replace(items, tokens=filled)


def bucket_positions(scales: Scales, bucket: int) -> Tensor:
    """Return the positions (S,) that a clip of `bucket` tokens has in the row of all scales; on the CPU on every
    device."""
    return scales.valid(torch.tensor([bucket], device="cpu"))[0].nonzero().squeeze(1)


def _positions(items: ScaleItems, scales: Scales) -> Tensor:
    longest = min(to_bucket(int(items.lengths.max())), scales.longest)
    return bucket_positions(scales, longest).to(items.tokens.device)


def _pass(
    model: ScaleTransformer,
    items: ScaleItems,
    tokens: Tensor,
    valid: Tensor,
    positions: Tensor,
    masked_left: Tensor,
    step: int,
    config: InferenceConfig,
) -> Tensor:
    """One pass: predict the masked tokens, keep all but the `masked_left` (B,) least confident. (B, S) -> (B, S)."""
    masked = (tokens == model.mask_token) & valid  # (B, S), M of them
    logits = model(
        tokens.repeat(2, 1),
        positions,
        valid.repeat(2, 1),
        torch.cat([items.words, items.null]),
        items.present.repeat(2, 1),
        config.guidance,
        masked.repeat(2, 1),
    )  # (M, K)
    noise = uniform(items.seeds, TOKEN_STREAM, step, positions)[masked]
    drawn = sample_top_k(logits, noise, temperature=config.temperature, share=config.top_k)  # (M,)
    # Confidence = the guided softmax itself, before temperature and top-k; tokens of earlier passes stay.
    sure = logits.gather(-1, drawn[:, None]).squeeze(-1) - logits.logsumexp(-1)
    confidence = sure.new_full(masked.shape, torch.inf).masked_scatter_(masked, sure)
    order = confidence.argsort(dim=1, stable=True)  # least confident first; ties go to the earlier position
    rank = torch.empty_like(order).scatter_(
        1, order, torch.arange(order.shape[1], device=order.device).expand_as(order)
    )
    filled = tokens.masked_scatter(masked, drawn)
    return filled.masked_fill(rank < masked_left[:, None], model.mask_token)
