"""Memory of MOGO's transformer stage, which needs most of all: a batch of 64 at the published sizes fills no GPU."""

from __future__ import annotations

from dataclasses import replace

import torch

from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.model import lanes
from marey.models.mogo.samples import SequenceSample
from marey.models.mogo.stage_transformer import piece_losses
from marey.training.memory import MemoryModel, SavedBytes, count_saved, matrices

PROMPTS = 2
"""Prompts of a training sample."""


def longest_samples(config: MOGOConfig, count: int) -> SequenceSample:
    """Return samples of the longest length, all frames of which are asked."""
    frames, levels = config.max_frames, config.tokenizer.levels
    return SequenceSample(
        prompts=torch.zeros(count, PROMPTS, config.condition.text_width),
        tokens=torch.randint(config.tokenizer.codes, (count, frames, levels)),
        lengths=torch.full((count,), frames),
        skipped=torch.zeros(count, dtype=torch.long),
        seam=torch.full((count,), frames + 1),
        ends=torch.ones(count, dtype=torch.bool),
    )


def memory_model(config: MOGOConfig, *, bf16: bool = True) -> MemoryModel:
    """Count the memory of the transformer's stage; see `marey.training.memory`.

    Args:
        config: of the bundle.
        bf16: matrices are in bfloat16.
    """
    with torch.device("meta"):
        module = build_transformer(config)
    rows = lanes(config) * (PROMPTS - 1 + module.leads + config.max_frames)
    return MemoryModel.counted(
        "transformer",
        config.train_transformer,
        module,
        lambda layers, count: _saved(config, layers, count, bf16),
        layers=config.transformer.layers,
        carried=rows * config.transformer.width * (2 if bf16 else 4),
    )


def _saved(config: MOGOConfig, layers: int, count: int, bf16: bool) -> SavedBytes:
    small = replace(config, transformer=replace(config.transformer, layers=layers))
    model, sample = build_transformer(small).train(), longest_samples(config, count)

    def forward() -> object:
        with matrices(bf16):
            sums, ahead = piece_losses(model, sample, config.depth.share)
        return sums.loss(config.first_level) + ahead

    return count_saved(forward, model)
