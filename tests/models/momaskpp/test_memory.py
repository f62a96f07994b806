"""The estimate of memory against what training uses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch

from marey.models.momaskpp.config import PAPER, Conditioning, MoMaskPPConfig, TransformerConfig
from marey.models.momaskpp.memory import longest_samples, memory_model
from marey.models.momaskpp.model import ScaleTransformer
from marey.models.momaskpp.stage_masked import masked_losses
from marey.nn.transformer import like_a_gpu
from tests.support.allocator import Peak, peak_of_steps, peak_on_gpu
from tests.support.processors import on_a_gpu


def small(layers: int, width: int, conditioning: Conditioning) -> MoMaskPPConfig:
    """The published network, made small."""
    return replace(
        PAPER,
        tokenizer=replace(PAPER.tokenizer, codes=300),
        text=replace(PAPER.text, width=96),
        masked=TransformerConfig(
            conditioning, layers=layers, heads=4, width=width, feedforward=3 * width, embedding=128
        ),
    )


def measured(config: MoMaskPPConfig, samples: int, peak: Peak = peak_of_steps) -> int:
    def parts(module: torch.nn.Module) -> Iterator[torch.Tensor]:
        assert isinstance(module, ScaleTransformer)
        for _ in range(2):
            sample = longest_samples(config, samples)
            yield masked_losses(module, sample, sample.tokens)[0]

    return peak(lambda: ScaleTransformer(config).train(), parts)


@pytest.mark.parametrize(
    ("layers", "width", "samples", "conditioning"), [(3, 64, 8, "cross-attention"), (5, 96, 4, "in-context")]
)
def test_the_estimate_is_within_a_tenth_of_what_is_used(
    layers: int, width: int, samples: int, conditioning: Conditioning
) -> None:
    config = small(layers, width, conditioning)
    torch.manual_seed(0)
    estimate = memory_model(config, bf16=False).estimate(samples)
    assert estimate.total == pytest.approx(measured(config, samples), rel=0.1), dict(estimate.parts)


@pytest.mark.parametrize(
    ("layers", "width", "samples", "conditioning"),
    [(3, 64, 8, "cross-attention"), pytest.param(5, 96, 4, "in-context", marks=pytest.mark.slow)],
)
def test_fused_attention_is_counted_as_such(layers: int, width: int, samples: int, conditioning: Conditioning) -> None:
    config = small(layers, width, conditioning)
    torch.manual_seed(0)
    stepwise = memory_model(config, bf16=False).estimate(samples)
    with like_a_gpu():
        fused = memory_model(config, bf16=False).estimate(samples)
        assert fused.total == pytest.approx(measured(config, samples), rel=0.1), dict(fused.parts)
    assert fused.total < 0.95 * stepwise.total


@pytest.mark.gpu
@on_a_gpu
def test_the_estimate_at_the_published_size_is_enough_on_a_gpu() -> None:
    with like_a_gpu():
        estimate = memory_model(PAPER).estimate(64).total
    assert estimate == pytest.approx(measured(PAPER, 64, peak_on_gpu), rel=0.1)


def test_a_step_is_a_batch() -> None:
    found = memory_model(small(2, 32, "cross-attention"))
    assert (found.stage, found.batch, found.layers) == ("masked", 64, 2)
