"""The decoding loops of HGM³ (Sec. 3.4): base tokens by confidence under three conditions, then residual levels.

An item's tokens depend on its own seed, text, length and kept tokens alone. A forward holds items of one bucket (a
multiple of 8 tokens) and both branches of guidance; each sequence has its readable rows first: padding changes no bit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from marey.generation.groups import GroupItems, KeepRows
from marey.models.hgm3.conditions import ACTION, MOTION, SPECIFIC
from marey.models.hgm3.config import InferenceConfig
from marey.models.hgm3.model import MaskedTransformer, ResidualTransformer, SeparateTransformers
from marey.nn.convolution import frame_mask
from marey.nn.masking import remaining_masks
from marey.nn.quantizer import NO_TOKEN
from marey.nn.sampling import sample_top_k, uniform

BASE_STREAM, RESIDUAL_STREAM, LENGTH_STREAM = 1, 2, 3
"""Streams of random numbers; see `marey.nn.sampling.uniform`."""


@dataclass(frozen=True)
class DecodeOptions:
    """Optimisations and variants; the first two change no token."""

    skip_idle: bool = True  # leave out passes that keep no token
    trim_slots: bool = True  # leave out slots that no item reads
    min_progress: bool = False  # keep at least one token per pass (ours); changes tokens


@dataclass(frozen=True)
class Items(GroupItems):
    """The items of one bucket."""

    lengths: Tensor  # (B,) own tokens n
    seeds: Tensor  # (B,) int64
    condition: Tensor  # (B, S, w) condition tokens of the masked transformer
    present: Tensor  # (B, S) bool
    sentence: Tensor  # (B, w') text token of the residual transformer
    free: Tensor  # (B,) bool: generated without condition
    tokens: Tensor  # (B, n_bucket, V) int64, NO_TOKEN where not decoded
    kept: Tensor  # (B, n_bucket) bool: tokens that stay as they are, at all levels
    decided: Tensor  # (B, 3) int64: base tokens that each level of condition decided


def condition_level(step: int, config: InferenceConfig) -> int:
    """Return C(l) of eq. 14 for pass l = 1 … L."""
    if step > config.action_steps:
        return SPECIFIC
    return MOTION if step <= config.motion_steps else ACTION


def decode_base(
    model: MaskedTransformer | SeparateTransformers,
    items: Items,
    config: InferenceConfig,
    options: DecodeOptions,
    keep: KeepRows,
) -> Items:
    """Fill `tokens[..., 0]`: L passes; each keeps the most confident tokens and never masks them again."""
    base = items.tokens[..., 0].masked_fill(~items.kept, model.mask_token)  # (B, n)
    open_counts = items.lengths - items.kept.sum(1)
    schedule = _schedules(open_counts, config.steps, options)  # (L + 1, B): masked before each pass, at last 0
    for step in range(1, config.steps + 1):
        before, after = schedule[step - 1], schedule[step]
        active = (after < before).nonzero().squeeze(1)
        rows = active if options.skip_idle and len(active) < len(base) else None
        if rows is None or len(rows):
            level = condition_level(step, config)
            some = items if rows is None else items.select(rows)
            masked_left = after if rows is None else after[rows]
            part = base if rows is None else base[rows]
            filled = _base_pass(model, some, part, masked_left, step, level, config, options)
            items.decided[:, level] += before - after
            if rows is None:
                base = filled
            else:
                base[rows] = filled
        stay = keep()
        if stay is not None:
            items, base, schedule = items.select(stay), base[stay], schedule[:, stay]
    valid = frame_mask(items.lengths, base.shape[1])
    tokens = items.tokens.clone()
    tokens[..., 0] = base.masked_fill(~valid, NO_TOKEN)
    return replace(items, tokens=tokens)


def _base_pass(
    model: MaskedTransformer | SeparateTransformers,
    items: Items,
    base: Tensor,
    masked_left: Tensor,
    step: int,
    level: int,
    config: InferenceConfig,
    options: DecodeOptions,
) -> Tensor:
    """One pass: predict at the masked tokens, keep all but the `masked_left` (B,) least confident. (B, n) -> (B, n)."""
    size = base.shape[1]
    valid = frame_mask(items.lengths, size)  # (B, n)
    guided = _base_logits(model, items, base, valid, level, config.guidance, options)  # (B, n, K)
    noise = uniform(items.seeds, BASE_STREAM, step, torch.arange(size, device=base.device))
    drawn = sample_top_k(guided, noise, temperature=config.temperature, share=config.top_k)  # (B, n)
    # Confidence = the guided softmax itself, before temperature and top-k.
    confidence = (guided.gather(-1, drawn[..., None]).squeeze(-1) - guided.logsumexp(-1)).masked_fill(
        (base != model.mask_token) | ~valid, torch.inf
    )
    order = confidence.argsort(dim=1, stable=True)  # least confident first; ties go to the earlier token
    rank = torch.empty_like(order).scatter_(1, order, torch.arange(size, device=base.device).expand_as(order))
    filled = torch.where(base == model.mask_token, drawn, base)
    return filled.masked_fill(rank < masked_left[:, None], model.mask_token)


def _base_logits(
    models: MaskedTransformer | SeparateTransformers,
    items: Items,
    base: Tensor,
    valid: Tensor,
    level: int,
    guidance: float,
    options: DecodeOptions,
) -> Tensor:
    """Return guided logits (B, n, K), from one forward pass of 2 B sequences."""
    model, condition = models.at_level(level, items.condition)
    null = torch.cat([model.condition.null.expand_as(condition[:, :1]), condition[:, 1:]], 1)
    visible = model.condition.visible(items.present, level)
    first = torch.zeros_like(visible)
    first[:, 0] = True
    condition = torch.where(items.free[:, None, None], null, condition)
    visible = torch.where(items.free[:, None], first, visible)
    return model(
        base.repeat(2, 1),
        valid.repeat(2, 1),
        torch.cat([condition, null]),
        torch.cat([visible, first]),
        (valid & (base == model.mask_token)).repeat(2, 1),
        trim=options.trim_slots,
        guidance=guidance,
    )


def decode_residual(
    model: ResidualTransformer, items: Items, config: InferenceConfig, options: DecodeOptions, keep: KeepRows
) -> Items:
    """Fill `tokens[..., 1:]` level by level, both branches of guidance in one forward."""
    size = items.tokens.shape[1]
    for level in range(1, model.levels):
        valid = frame_mask(items.lengths, size)
        below = [model.embed(items.tokens[..., v], v) for v in range(level)]
        total = torch.stack(below).sum(0)  # (B, n, d)
        levels = torch.full_like(items.lengths, level).repeat(2)
        null = model.null.expand_as(items.sentence)
        both = torch.cat([torch.where(items.free[:, None], null, items.sentence), null])  # (2 B, w')
        guided = model(
            total.repeat(2, 1, 1),
            valid.repeat(2, 1),
            levels,
            both,
            trim=options.trim_slots,
            guidance=config.residual_guidance,
        )
        noise = uniform(items.seeds, RESIDUAL_STREAM, level, torch.arange(size, device=valid.device))
        drawn = sample_top_k(
            guided, noise, temperature=config.residual_temperature, share=config.residual_top_k
        ).masked_fill(~valid, NO_TOKEN)
        tokens = items.tokens.clone()
        tokens[..., level] = torch.where(items.kept, tokens[..., level], drawn)
        items = replace(items, tokens=tokens)
        stay = keep()
        items = items if stay is None else items.select(stay)
    return items


def _schedules(counts: Tensor, steps: int, options: DecodeOptions) -> Tensor:
    """Return the number of masked tokens before pass 1 and after each pass, (L + 1, B), of `counts` (B,) to decode."""
    columns = [[n, *remaining_masks(n, steps, min_progress=options.min_progress)] for n in counts.tolist()]
    return torch.tensor(columns, device=counts.device).T.contiguous()
