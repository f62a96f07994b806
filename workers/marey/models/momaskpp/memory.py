"""Memory of MoMask++'s masked stage, on the longest motions with captions of the most words."""

from __future__ import annotations

from dataclasses import replace

import torch

from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.model import ScaleTransformer, TextStates
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.stage_masked import ScaleSample, masked_losses
from marey.training.memory import MemoryModel, SavedBytes, count_saved, matrices


def memory_model(config: MoMaskPPConfig, *, bf16: bool = True) -> MemoryModel:
    """Count the memory of the masked transformer; see `marey.training.memory`.

    Args:
        config: of the bundle.
        bf16: matrices are in bfloat16.
    """

    def count(layers: int, samples: int) -> SavedBytes:
        model = ScaleTransformer(replace(config, masked=replace(config.masked, layers=layers))).train()
        sample = longest_samples(config, samples)

        def forward() -> object:
            with matrices(bf16):
                loss, _, _ = masked_losses(model, sample, sample.tokens)
            return loss

        return count_saved(forward, model)

    with torch.device("meta"):
        module = ScaleTransformer(config)
    return MemoryModel.counted("masked", config.train_masked, module, count, layers=config.masked.layers)


def longest_samples(config: MoMaskPPConfig, count: int) -> ScaleSample:
    """Return samples of the longest length, all of whose tokens are masked."""
    size, words = Scales.of(config).size, config.text.max_words
    there = torch.ones(count, size, dtype=torch.bool)
    text = TextStates(torch.randn(count, words, config.text.width), torch.ones(count, words, dtype=torch.bool))
    tokens = torch.randint(config.tokenizer.codes, (count, size))
    return ScaleSample(tokens, torch.arange(size), there, text, there, torch.zeros(count, dtype=torch.bool))
