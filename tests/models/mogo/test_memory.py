"""Gradient accumulation, activations that are computed again, and the estimate of memory."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidInput
from marey.data.prepared import PreparedData
from marey.models.mogo.config import PAPER, TINY, MOGOConfig, TransformerConfig
from marey.models.mogo.memory import longest_samples, memory_model
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.stage_transformer import TransformerStage, piece_losses
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.memory import GIB, Amount, MemoryModel
from marey.training.motions import MotionData, TokenData
from marey.training.sentences import SentenceData
from marey.training.stages import StepContext
from marey.training.staging import set_recompute
from marey.training.texts import CaptionTexts
from tests.support.allocator import Peak, peak_of_steps, peak_on_gpu
from tests.support.processors import on_a_gpu

PLAIN = replace(
    TINY,
    ahead=(),
    steers=0,
    split_actions=False,
    corruption=0.0,
    depth=replace(TINY.depth, layers=0, share=1.0),
    condition=replace(TINY.condition, drop=0.0, clock=False),
    transformer=replace(TINY.transformer, dropout=0.0),
)
"""A configuration without random choices in the forward pass."""


def stage_of(prepared: PreparedData, config: MOGOConfig = PLAIN) -> TransformerStage:
    data = MotionData.load(prepared.path, torch.device("cpu"))
    torch.manual_seed(0)
    tokenizer = Tokenizer(config)
    tokenizer.quantizer.codebooks.normal_()
    texts = CaptionTexts.load(prepared)
    captions = SentenceData.of_sentences(texts, prepared.caption_counts, 384, torch.device("cpu"))
    return TransformerStage(config, prepared.clips, TokenData.encode(tokenizer, data), captions)


def gradients(stage: TransformerStage, size: int | None) -> dict[str, torch.Tensor]:
    stage.module.zero_grad()
    context = StepContext(0, 0.5, np.random.default_rng(0))
    torch.manual_seed(0)
    losses = [stage.loss(context)] if size is None else list(stage.parts(context, size))
    for loss, _ in losses:
        loss.backward()
    return {name: each.grad.clone() for name, each in stage.module.named_parameters() if each.grad is not None}


@pytest.mark.parametrize("size", [1, 3])
def test_gradients_of_parts_add_up_to_those_of_the_batch(prepared: PreparedData, size: int) -> None:
    stage = stage_of(prepared, replace(PLAIN, train_transformer=replace(PLAIN.train_transformer, batch=7)))
    whole, parts = gradients(stage, None), gradients(stage, size)
    assert whole.keys() == parts.keys()
    for name, wanted in whole.items():
        torch.testing.assert_close(parts[name], wanted, atol=1e-6, rtol=1e-4, msg=name)


def test_activations_that_are_computed_again_change_no_gradient(prepared: PreparedData) -> None:
    stage = stage_of(prepared, replace(PLAIN, transformer=replace(PLAIN.transformer, dropout=0.2)))
    wanted = gradients(stage, None)
    set_recompute(stage.module)
    assert stage.module.trunk.recompute
    for name, found in gradients(stage, None).items():
        torch.testing.assert_close(found, wanted[name], atol=1e-6, rtol=1e-5, msg=name)
    with pytest.raises(InvalidInput, match="--recompute"):
        set_recompute(torch.nn.Linear(2, 2))


def test_what_cannot_be_split_is_refused(prepared: PreparedData) -> None:
    stage = stage_of(prepared, replace(PLAIN, ahead=(3,)))
    with pytest.raises(InvalidInput, match="excludes `ahead`"):
        next(stage.parts(StepContext(0, 0.5, np.random.default_rng(0)), 2))


def small(layers: int, width: int) -> MOGOConfig:
    """The published network, made small."""
    return replace(
        PAPER,
        max_frames=64,
        tokenizer=replace(PAPER.tokenizer, levels=3, codes=500),
        transformer=TransformerConfig(layers=layers, heads=4, width=width, feedforward=4 * width),
        condition=replace(PAPER.condition, text_width=384),
        train_transformer=replace(PAPER.train_transformer, batch=8),
    )


def measured(config: MOGOConfig, samples: int, *, recompute: bool, peak: Peak = peak_of_steps) -> int:
    """Largest number of bytes in use during a step of two parts."""

    def build() -> RQHCTransformer:
        model = RQHCTransformer(config).train()
        model.trunk.recompute = recompute
        return model

    def parts(model: torch.nn.Module) -> Iterator[torch.Tensor]:
        assert isinstance(model, RQHCTransformer)
        for _ in range(2):
            yield piece_losses(model, longest_samples(config, samples), 1.0)[0].loss(1.0)

    torch.manual_seed(0)
    return peak(build, parts)


@pytest.mark.parametrize(
    ("layers", "width", "samples", "recompute"),
    [(3, 64, 6, False), pytest.param(5, 96, 3, False, marks=pytest.mark.slow), (5, 96, 4, True)],
)
def test_the_estimate_is_within_a_tenth_of_what_is_used(layers: int, width: int, samples: int, recompute: bool) -> None:
    config = small(layers, width)
    found = measured(config, samples, recompute=recompute)
    estimate = memory_model(config, bf16=False).estimate(samples, recompute=recompute)
    assert estimate.total == pytest.approx(found, rel=0.1), dict(estimate.parts)


@pytest.mark.parametrize(
    ("layers", "width", "codes", "samples", "bf16"),
    [
        pytest.param(5, 96, 500, 4, False, marks=pytest.mark.slow),
        (5, 96, 500, 4, True),
        (3, 128, PAPER.tokenizer.codes, 2, False),
        pytest.param(3, 128, PAPER.tokenizer.codes, 2, True, marks=pytest.mark.slow),
    ],
)
def test_layers_that_are_computed_again_are_estimated_in_both_number_types(
    layers: int, width: int, codes: int, samples: int, bf16: bool
) -> None:
    config = small(layers, width)
    config = replace(config, tokenizer=replace(config.tokenizer, codes=codes))
    found = measured(config, samples, recompute=True, peak=partial(peak_of_steps, bf16=bf16))
    estimate = memory_model(config, bf16=bf16).estimate(samples, recompute=True)
    assert estimate.total == pytest.approx(found, rel=0.1), dict(estimate.parts)
    assert ("behind the layers" in estimate.parts) == (codes > 500)


@pytest.mark.gpu
@on_a_gpu
@pytest.mark.parametrize(("samples", "recompute"), [(4, False), (16, True)])
def test_the_estimate_at_the_published_size_is_within_a_tenth_of_what_a_gpu_uses(samples: int, recompute: bool) -> None:
    found = measured(PAPER, samples, recompute=recompute, peak=peak_on_gpu)
    estimate = memory_model(PAPER).estimate(samples, recompute=recompute)
    assert estimate.total == pytest.approx(found, rel=0.1), dict(estimate.parts)


def test_amounts_grow_with_layers_and_samples_alone() -> None:
    amount = Amount.of(lambda layers, samples: 7 + 5 * layers + samples * (3 + 2 * layers))
    assert (amount.fixed, amount.layer, amount.sample, amount.both) == (7, 5, 3, 2)
    assert amount.at(18, 64) == 7 + 5 * 18 + 64 * (3 + 36)


def test_as_many_samples_as_fit_are_chosen() -> None:
    model = MemoryModel("transformer", 64, 10, GIB, GIB, 0, {"float32": Amount(0, 0, 0, GIB / 10)}, 0, GIB / 100)
    assert model.fit(24 * GIB / 0.92).samples == 20
    assert model.fit(1000 * GIB).samples == 64
    assert model.estimate(20, recompute=True).total < model.estimate(20).total
    with pytest.raises(InvalidInput, match=r"needs 5\.0 GiB for one sample; there are 4\.0"):
        model.fit(4 * GIB)
