"""Memory of HGM³'s two transformer stages, on the longest motions with every slot of the condition in use."""

from __future__ import annotations

from dataclasses import replace

import torch

from marey.models.hgm3.conditions import LEVELS, GraphBatch
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.model import ResidualTransformer
from marey.models.hgm3.stage_masked import CONDITIONS, MaskedModule, MaskedObjective, MaskedSample
from marey.models.hgm3.stage_residual import ResidualSample, piece_losses
from marey.training.memory import MemoryModel, SavedBytes, count_saved, matrices


def memory_model(config: HGM3Config, *, bf16: bool = True) -> MemoryModel:
    """Count the memory of the stage that needs most; see `marey.training.memory`."""
    found = [masked_memory(config, bf16=bf16), residual_memory(config, bf16=bf16)]
    return max(found, key=lambda each: each.estimate(each.batch).total)


def masked_memory(config: HGM3Config, *, bf16: bool = True) -> MemoryModel:
    """Count the memory of F and G. A step has each sample once under each condition that it is trained on.

    Args:
        config: of the bundle.
        bf16: matrices are in bfloat16.
    """

    def count(layers: int, samples: int) -> SavedBytes:
        small = replace(config, masked=replace(config.masked, layers=layers))
        objective = MaskedObjective(small, MaskedModule(small).train())
        sample = longest_masked(config, samples)

        def forward() -> object:
            with matrices(bf16):
                losses, masked, _, ranking = objective.piece(sample, 0.0)
            return (losses * masked).sum() + ranking.sum()

        return count_saved(forward, objective.module)

    mining = config.mining
    every = mining.conditions == "all" and mining.levels_per_step == LEVELS
    with torch.device("meta"):
        module = MaskedModule(config)
    batch = config.train_masked.batch * (LEVELS if every else 1)
    return MemoryModel.counted("masked", config.train_masked, module, count, layers=config.masked.layers, batch=batch)


def residual_memory(config: HGM3Config, *, bf16: bool = True) -> MemoryModel:
    """Count the memory of the residual transformer; arguments as in `masked_memory`."""

    def count(layers: int, samples: int) -> SavedBytes:
        model = ResidualTransformer(replace(config, residual=replace(config.residual, layers=layers))).train()
        sample = longest_residual(config, samples)

        def forward() -> object:
            with matrices(bf16):
                losses, _, _ = piece_losses(model, sample)
            return losses.sum()

        return count_saved(forward, model)

    with torch.device("meta"):
        module = ResidualTransformer(config)
    return MemoryModel.counted("residual", config.train_residual, module, count, layers=config.residual.layers)


def longest_masked(config: HGM3Config, count: int) -> MaskedSample:
    """Return samples of the longest length under the full condition, all of whose tokens are masked."""
    c, length = config.condition, config.max_tokens
    graphs = GraphBatch(
        nodes=torch.randn(count, c.slots, c.text_width),
        adjacency=torch.zeros(count, c.slots, c.slots, dtype=torch.long),
        present=torch.ones(count, c.slots, dtype=torch.bool),
    )
    return MaskedSample(
        tokens=torch.randint(config.tokenizer.codes, (count, length)),
        lengths=torch.full((count,), length),
        graphs=graphs,
        progress=torch.zeros(count),
        noise=torch.rand(count, length),
        dropped=torch.zeros(count, dtype=torch.bool),
        level=torch.full((count,), CONDITIONS.index("specific")),
    )


def longest_residual(config: HGM3Config, count: int) -> ResidualSample:
    """Return samples of the longest length; their levels differ where there are two."""
    tokenizer = config.tokenizer
    return ResidualSample(
        tokens=torch.randint(tokenizer.codes, (count, config.max_tokens, tokenizer.levels)),
        lengths=torch.full((count,), config.max_tokens),
        sentences=torch.randn(count, config.condition.text_width),
        levels=1 + torch.arange(count) % (tokenizer.levels - 1),
        dropped=torch.zeros(count, dtype=torch.bool),
    )
