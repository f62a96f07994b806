"""Validation figures of networks that know nothing, and passes that decoding leaves out."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch

from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.models.hgm3.config import TINY
from marey.models.hgm3.generate import Generator, SamplingSettings
from marey.models.hgm3.stage_masked import CONDITIONS
from marey.models.hgm3.stage_residual import ResidualStage
from tests.models.hgm3.test_objective import encoded, masked_stage
from tests.support.generating import equal_motions
from tests.support.prepared import text_features

CODES = TINY.tokenizer.codes


def test_a_masked_transformer_that_knows_nothing_is_right_by_chance_under_every_condition(
    prepared: PreparedData,
) -> None:
    stage = masked_stage(prepared)
    stage.module.eval()
    for parameter in stage.module.masked.head.parameters():
        parameter.data.zero_()
    found = stage.validate()
    assert found.keys() == {f"{name}/{level}" for name in ("reconstruction", "accuracy") for level in CONDITIONS} | {
        "ranking"
    }
    for level in CONDITIONS:
        assert found[f"reconstruction/{level}"] == pytest.approx(math.log(CODES), rel=1e-4)
        assert found[f"accuracy/{level}"] == pytest.approx(1 / CODES, rel=1e-3)
    assert 0 < found["ranking"] < 5


def test_a_residual_transformer_that_knows_nothing_is_right_by_chance_on_every_level(prepared: PreparedData) -> None:
    tokenizer, tokens, captions = encoded(prepared, TINY)
    stage = ResidualStage(TINY, prepared.clips, tokens, captions, tokenizer.codebooks)
    stage.module.eval()
    stage.module.bias.data.zero_()
    stage.module.set_codebooks(torch.zeros_like(tokenizer.codebooks))
    found = stage.validate()
    for level in range(1, TINY.tokenizer.levels):
        assert found[f"loss/{level}"] == pytest.approx(math.log(CODES), rel=1e-4)
        assert found[f"accuracy/{level}"] == pytest.approx(1 / CODES, rel=1e-3)


def test_a_pass_that_keeps_no_token_is_left_out_and_so_are_the_items_that_it_keeps_none_of(
    generator: Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up to 81 tokens the first pass keeps none; short motions have many passes that keep none."""
    rows: list[int] = []
    plain = type(generator.networks.masked).forward

    def forward(self: Any, tokens: torch.Tensor, *rest: Any, **options: Any) -> torch.Tensor:
        rows.append(len(tokens) // 2)  # with and without the prompt
        return plain(self, tokens, *rest, **options)

    monkeypatch.setattr(type(generator.networks.masked), "forward", forward)
    asked = [Request(text_features(i), i, frames) for i, frames in enumerate((20, 32))]
    made = [generator.generate(asked, SamplingSettings(steps=10, skip_idle=skip)) for skip in (False, True)]
    assert rows[:10] == [2] * 10
    kept = rows[10:]
    assert len(kept) < 10, "no pass without an item"
    assert 1 in kept, "an item that waits is not computed"
    assert sum(kept) <= 5 + 8, "an item has no more passes than tokens"
    assert equal_motions(*made)
