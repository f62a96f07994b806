"""Tiny networks with random weights, and what goes into them."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256

import torch

from marey.models.mogo.config import TINY, InferenceConfig, MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.streaming import StreamBatch

FLAT = replace(TINY, depth=replace(TINY.depth, layers=0))
TOLD_BY_TOKEN = replace(FLAT, transformer=replace(FLAT.transformer, level_token=True))
"""The level is a token of its own."""


def transformer(config: MOGOConfig = TINY) -> RQHCTransformer:
    """In evaluation mode, nothing at zero where training starts."""
    torch.manual_seed(0)
    made = build_transformer(config).eval()
    for parameter in made.parameters():
        parameter.data.add_(0.1 * torch.randn_like(parameter))
    made.prompt.mean.normal_()
    made.prompt.std.uniform_(0.5, 1.5)
    return made


def opened(
    model: RQHCTransformer,
    capacity: int,
    config: InferenceConfig | None = None,
    *,
    dtype: torch.dtype = torch.float32,
    group: int = 1,
) -> StreamBatch:
    """Room for sessions of a model."""
    return StreamBatch(packed(model, dtype=dtype, group=group), capacity, config)


_packed: dict[tuple[object, ...], PackedModel] = {}


def packed(model: RQHCTransformer, *, dtype: torch.dtype = torch.float32, group: int = 1) -> PackedModel:
    """The inference twin of a model, the same one for equal weights: building it takes over a tenth of a second."""
    weights = sha256()
    for name, tensor in model.state_dict().items():
        weights.update(name.encode())
        weights.update(tensor.numpy())
    key = (type(model), model.config, weights.digest(), dtype, group)
    if key not in _packed:
        _packed[key] = PackedModel(model, dtype=dtype, group=group)
    return _packed[key]


def columns(frames: int, batch: int = 1, config: MOGOConfig = TINY) -> torch.Tensor:
    """Random tokens (batch, frames, V)."""
    generator = torch.Generator().manual_seed(frames)
    return torch.randint(config.tokenizer.codes, (batch, frames, config.tokenizer.levels), generator=generator)


def prompts(batch: int, *, seed: int = 0) -> torch.Tensor:
    """Made-up sentence features (batch, 1, W)."""
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(batch, 1, TINY.condition.text_width, generator=generator)
