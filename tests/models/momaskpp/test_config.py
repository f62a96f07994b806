"""Configurations: what the paper gives in `paper`, what published weights need in `released-…`, ours elsewhere."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from marey.models.momaskpp.config import (
    OPEN,
    PAPER,
    RELEASED_HUMANML3D,
    RELEASED_SNAPMOGEN,
    STARTER,
    TINY,
    InferenceConfig,
    MoMaskPPConfig,
    PerturbationConfig,
)
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.tokenizer import Tokenizer


def test_paper_is_what_the_paper_gives_and_nothing_of_ours() -> None:
    t, m = PAPER.tokenizer, PAPER.masked
    assert (t.scales, t.codes, t.code_width, t.layout) == ((8, 4, 2, 1), 512, 512, "own")
    assert (t.rotation_weight, t.position_weight, t.velocity_weight, t.world_weight) == (1, 0, 0, 0)
    assert (m.layers, m.heads, m.width, m.feedforward) == (8, 6, 384, 1024)
    assert PAPER.inference == InferenceConfig(steps=18, guidance=4.0, temperature=1.0, top_k=0.1)
    assert (PAPER.text.width, PAPER.text.max_words, PAPER.text.noise) == (768, 20, 0)
    assert not PAPER.has_length
    assert not PAPER.has_refiner
    assert not [stage for stage in ("tokenizer", "masked", "refiner") if getattr(PAPER, f"train_{stage}").ema]


@pytest.mark.parametrize(
    ("config", "sizes"),
    [
        (
            RELEASED_HUMANML3D,
            {
                "body": ("humanml3d-263", 263, 22, 20.0, 196),
                "scales": (8, 4, 2, 1),
                "codes": 512,
                "heads": 6,
                "words": 20,
                "inference": (18, 5.0),
                "essential": (4, 67),
                "bias": 5.0,
                "open": (140, 160, 180),
            },
        ),
        (
            RELEASED_SNAPMOGEN,
            {
                "body": ("snapmogen-296", 296, 24, 30.0, 320),
                "scales": (2, 1),
                "codes": 2048,
                "heads": 8,
                "words": 120,
                "inference": (16, 4.0),
                "essential": (0, 148),
                "bias": 1.0,
                "open": (208, 240, 272),
            },
        ),
    ],
    ids=lambda each: each.name if isinstance(each, MoMaskPPConfig) else "",
)
def test_published_weights_are_read_at_their_sizes(config: MoMaskPPConfig, sizes: dict[str, object]) -> None:
    t = config.tokenizer
    assert sizes == {
        "body": (config.layout, config.features, config.joints, config.fps, config.max_frames),
        "scales": t.scales,
        "codes": t.codes,
        "heads": config.masked.heads,
        "words": config.text.max_words,
        "inference": (config.inference.steps, config.inference.guidance),
        "essential": t.essential,
        "bias": t.feature_bias,
        "open": config.open_frames,
    }
    assert (t.layout, t.code_width, config.perturbation.padded_counts) == ("padded", 512, True)
    assert config.masked == replace(PAPER.masked, heads=config.masked.heads)
    assert t.commitment == pytest.approx(0.02 * 512 / config.max_tokens, abs=5e-4), "published per token"
    assert config.has_refiner == (config is RELEASED_SNAPMOGEN)
    assert all(config.min_frames <= frames <= config.max_frames for frames in config.open_frames)


def test_a_motion_of_the_longest_length_has_its_tokens_of_every_scale() -> None:
    for config, counts in ((PAPER, [6, 12, 24, 49]), (RELEASED_SNAPMOGEN, [40, 80]), (OPEN, [6, 12, 24, 49])):
        scales = Scales.of(config)
        assert [block.shape[1] for block in scales.split(torch.zeros(1, scales.size))] == counts


def test_ours_train_with_the_terms_on_joints_and_a_length_estimator() -> None:
    for config in (STARTER, OPEN):
        t = config.tokenizer
        assert (t.position_weight, t.velocity_weight, t.world_weight) == (5, 0.5, 2)
        assert config.perturbation == PerturbationConfig(replace_random=0.0, replace_mask=1.0)
        assert config.has_length
        assert not config.has_refiner
    tokenizer = replace(STARTER.tokenizer, codes=1024)
    assert replace(STARTER, name="open", tokenizer=tokenizer, phases=1, speeds=False) == OPEN


def test_tiny_has_every_part() -> None:
    assert TINY.has_length
    assert TINY.has_refiner
    assert Tokenizer(TINY).codebooks.shape == (1, 32, 16)
