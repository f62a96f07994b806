"""The estimates of memory against what training uses, and `auto` samples of a pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch

from marey.core.errors import InvalidInput
from marey.models.hgm3.config import PAPER, STARTER, HGM3Config, TransformerConfig
from marey.models.hgm3.memory import longest_masked, longest_residual, masked_memory, memory_model, residual_memory
from marey.models.hgm3.model import ResidualTransformer
from marey.models.hgm3.stage_masked import MaskedModule, MaskedObjective
from marey.models.hgm3.stage_residual import piece_losses
from marey.nn.transformer import like_a_gpu
from marey.training.memory import MemoryEstimate
from tests.support.allocator import Peak, peak_of_steps, peak_on_gpu
from tests.support.processors import on_a_gpu


def small(layers: int, width: int) -> HGM3Config:
    """The published networks, made small."""
    network = TransformerConfig(layers=layers, heads=4, width=width, feedforward=3 * width)
    return replace(
        PAPER,
        tokenizer=replace(PAPER.tokenizer, levels=3, codes=300),
        condition=replace(PAPER.condition, text_width=96),
        masked=network,
        predictor=replace(network, layers=2),
        residual=network,
    )


def measured_masked(config: HGM3Config, samples: int, peak: Peak = peak_of_steps) -> int:
    def parts(module: torch.nn.Module) -> Iterator[torch.Tensor]:
        assert isinstance(module, MaskedModule)
        for _ in range(2):
            losses, masked, _, ranking = MaskedObjective(config, module).piece(longest_masked(config, samples), 0.5)
            yield (losses * masked).sum() / masked.sum() + ranking.mean()
            del losses, ranking

    return peak(lambda: MaskedModule(config).train(), parts)


def measured_residual(config: HGM3Config, samples: int, peak: Peak = peak_of_steps) -> int:
    def parts(module: torch.nn.Module) -> Iterator[torch.Tensor]:
        assert isinstance(module, ResidualTransformer)
        for _ in range(2):
            yield piece_losses(module, longest_residual(config, samples))[0].sum()

    return peak(lambda: ResidualTransformer(config).train(), parts)


def check(estimate: MemoryEstimate, found: int) -> None:
    assert estimate.total == pytest.approx(found, rel=0.1), dict(estimate.parts)


@pytest.mark.parametrize(("layers", "width", "samples"), [(3, 64, 12), pytest.param(5, 96, 6, marks=pytest.mark.slow)])
def test_the_estimates_are_within_a_tenth_of_what_is_used(layers: int, width: int, samples: int) -> None:
    config = small(layers, width)
    torch.manual_seed(0)
    check(masked_memory(config, bf16=False).estimate(samples), measured_masked(config, samples))
    check(residual_memory(config, bf16=False).estimate(samples), measured_residual(config, samples))


@pytest.mark.parametrize(("layers", "width", "samples"), [pytest.param(3, 64, 12, marks=pytest.mark.slow), (5, 96, 6)])
def test_fused_attention_is_counted_as_such(layers: int, width: int, samples: int) -> None:
    config = small(layers, width)
    torch.manual_seed(0)
    stepwise = masked_memory(config, bf16=False).estimate(samples)
    with like_a_gpu():
        fused = masked_memory(config, bf16=False).estimate(samples)
        check(fused, measured_masked(config, samples))
        check(residual_memory(config, bf16=False).estimate(samples), measured_residual(config, samples))
    assert fused.total < 0.95 * stepwise.total


@pytest.mark.gpu
@on_a_gpu
def test_the_estimates_at_the_published_size_are_enough_on_a_gpu() -> None:
    with like_a_gpu():
        masked, residual = masked_memory(PAPER).estimate(64).total, residual_memory(PAPER).estimate(64).total
    for estimate, found in (
        (masked, measured_masked(PAPER, 64, peak_on_gpu)),
        (residual, measured_residual(PAPER, 64, peak_on_gpu)),
    ):
        assert estimate == pytest.approx(found, rel=0.1)


def test_the_stage_that_needs_most_is_shown_with_all_conditions_of_a_step() -> None:
    config = small(2, 32)
    found = memory_model(config)
    assert (found.stage, found.batch) == ("masked", 3 * 256)
    assert masked_memory(replace(config, mining=replace(config.mining, conditions="motion"))).batch == 256
    assert masked_memory(replace(config, mining=STARTER.mining)).batch == 256
    wide = replace(config, residual=replace(config.residual, width=256, layers=8), mining=STARTER.mining)
    assert memory_model(wide).stage == "residual"
    with pytest.raises(InvalidInput, match="masked cannot compute layers again"):
        found.fit(1e12, recompute=True)
