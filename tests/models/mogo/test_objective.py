"""The training objective of MOGO, term by term: each test fails when its term is left out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.data.prepared import PreparedData
from marey.models.mogo import train
from marey.models.mogo.config import TINY, MOGOConfig
from marey.models.mogo.losses import LevelSums, scale_penalty
from marey.models.mogo.stage_transformer import TransformerStage
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.budget import Budget
from marey.training.motions import MotionData, TokenData
from marey.training.sentences import SentenceData
from marey.training.stages import StepContext
from marey.training.staging import TrainOptions
from marey.training.texts import CaptionTexts
from marey.training.tokenizing import TokenizerStage
from tests.support.recording import assert_recordable

CPU = torch.device("cpu")


class Stop(Exception):
    """Ends a training that has shown what it was asked for."""


def test_training_the_tokenizer_adds_the_regularizer_of_the_scales(
    prepared: PreparedData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Eq. 6, last term: gamma times the squares of scale - 1 and bias, in the loss that `marey train` minimises."""
    totals: list[float] = []

    def watched(stage: TokenizerStage, _options: object) -> dict[str, float]:
        for scale in stage.module.quantizer.scales:  # type: ignore[union-attr]
            scale.data.fill_(1.5)
        torch.manual_seed(1)
        stage.module.eval()
        totals.append(float(stage.loss(StepContext(0, 0.0, np.random.default_rng(0)))[0].detach()))
        raise Stop

    monkeypatch.setattr(type(train.RECIPE), "train", lambda _self, stage, options: watched(stage, options))
    for gamma in (0.0, 3.0):
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, regularizer=gamma))
        options = TrainOptions[MOGOConfig](
            prepared.path, tmp_path, config, Budget(steps=1), device="cpu", bf16=False, quiet=True
        )
        with pytest.raises(Stop):
            train.train_stage("tokenizer", options)
    # (1.5 - 1)² a level
    assert totals[1] - totals[0] == pytest.approx(3.0 * TINY.tokenizer.levels * 0.25, rel=1e-3)
    assert TINY.tokenizer.regularizer > 0


def transformer_stage(prepared: PreparedData, config: MOGOConfig) -> TransformerStage:
    torch.manual_seed(0)
    tokenizer = Tokenizer(config).eval()
    tokenizer.quantizer.codebooks.normal_()
    tokens = TokenData.encode(tokenizer, MotionData.load(prepared.path, CPU))
    captions = SentenceData.of_sentences(CaptionTexts.load(prepared), prepared.caption_counts, 384, CPU)
    return TransformerStage(config, prepared.clips, tokens, captions)


def test_the_first_level_weighs_what_the_configuration_says(
    prepared: PreparedData, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[float] = []
    loss = LevelSums.loss

    def watched(sums: LevelSums, first_level: float) -> torch.Tensor:
        asked.append(first_level)
        return loss(sums, first_level)

    monkeypatch.setattr(LevelSums, "loss", watched)
    for weight in (1.0, 5.0):
        stage = transformer_stage(prepared, replace(TINY, first_level=weight))
        stage.loss(StepContext(0, 0.0, np.random.default_rng(0)))
        stage.validate()
    assert asked == [1.0, 1.0, 5.0, 5.0]


def test_a_heavier_first_level_moves_the_loss_towards_its_own() -> None:
    sums = LevelSums(torch.tensor([8.0, 2.0]), torch.tensor([0, 0]), torch.tensor([2, 2]))
    losses = [float(sums.loss(weight)) for weight in (1.0, 3.0, 1e6)]
    assert losses[0] == pytest.approx(2.5)
    assert losses[1] == pytest.approx((3 * 4 + 1) / 4)
    assert losses[2] == pytest.approx(4.0, rel=1e-3)


def test_steps_of_both_networks_can_be_recorded(prepared: PreparedData) -> None:
    data = MotionData.load(prepared.path, CPU)
    tokenizer = Tokenizer(TINY)
    stage = TokenizerStage(TINY, data, tokenizer, lambda: scale_penalty(tokenizer, TINY.tokenizer))
    assert_recordable(stage)
    assert_recordable(transformer_stage(prepared, TINY))


def test_a_padded_batch_has_the_loss_of_its_pieces(prepared: PreparedData) -> None:
    config = replace(
        TINY, corruption=0.0, ahead=(), depth=replace(TINY.depth, share=1.0),
        transformer=replace(TINY.transformer, dropout=0.0), condition=replace(TINY.condition, drop=0.0, clockless=0.0),
    )  # fmt: skip
    stage = transformer_stage(prepared, config)
    loss, logs = stage.loss(StepContext(0, 0.0, np.random.default_rng(0)))
    batch = stage.batch(StepContext(0, 0.0, np.random.default_rng(0)))
    padded, shown = stage.batch_loss(batch)
    assert batch.tokens.shape[1] == config.max_frames
    torch.testing.assert_close(padded, loss)
    assert float(shown["level_0"]) == pytest.approx(float(logs["level_0"]))
