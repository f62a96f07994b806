"""Memory of MOGO's transformer stage, which needs most of all: a batch of 64 at the published sizes fills no GPU."""

from __future__ import annotations

from dataclasses import replace

import torch

from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.model import RQHCTransformer, lanes
from marey.models.mogo.samples import SequenceSample
from marey.models.mogo.stage_transformer import piece_losses
from marey.training.memory import Amount, MemoryModel, SavedBytes, count_saved, matrices

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
    found = {(layers, count): _saved(config, layers, count, bf16) for layers in (1, 2) for count in (1, 2)}
    names = sorted({name for each in found.values() for name in each.by_dtype})
    with torch.device("meta"):
        module = RQHCTransformer(config)
    weights = sum(each.numel() * each.element_size() for each in (*module.parameters(), *module.buffers()))
    rows = lanes(config) * (PROMPTS + config.max_frames)
    return MemoryModel(
        stage="transformer",
        batch=config.train_transformer.batch,
        layers=config.transformer.layers,
        weights=weights,
        average=weights if config.train_transformer.ema else 0,
        saved={
            name: Amount.of(lambda layers, count, name=name: found[layers, count].by_dtype.get(name, 0))
            for name in names
        },
        largest=found[1, 2].largest - found[1, 1].largest,
        carried=rows * config.transformer.width * (2 if bf16 else 4),
    )


def _saved(config: MOGOConfig, layers: int, count: int, bf16: bool) -> SavedBytes:
    small = replace(config, transformer=replace(config.transformer, layers=layers))
    model, sample = RQHCTransformer(small).train(), longest_samples(config, count)

    def forward() -> object:
        with matrices(bf16):
            sums, ahead = piece_losses(model, sample, config.depth.share)
        return sums.loss(config.first_level) + ahead

    return count_saved(forward, model)
