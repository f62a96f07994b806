"""A level token is read by its lane and no other, and a bundle that has one generates."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidInput
from marey.generation.port import Request
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY, MOGOConfig
from marey.models.mogo.generate import Generator, SamplingSettings
from marey.models.mogo.level_token import LevelToken
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.memory import memory_model
from tests.support.prepared import text_features

from .networks import FLAT, TOLD_BY_TOKEN, columns, opened, prompts, transformer


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    """A generator of random weights whose level is a token."""
    bundle = random_bundle(tmp_path_factory.mktemp("mogo") / "told-by-token", TOLD_BY_TOKEN)
    return Generator.load(bundle, device="cpu", threads=1)


def test_a_level_token_is_read_by_its_own_lane_from_the_first_frame_on() -> None:
    torch.manual_seed(0)
    model = LevelToken(TOLD_BY_TOKEN).eval().requires_grad_(False)
    told, tokens = prompts(2), columns(5, 2)
    before = model.states(told, tokens)
    assert before.shape == (2, 6, TINY.tokenizer.levels, TINY.transformer.width)
    model.level_token[1] += torch.randn(TINY.transformer.width)
    changed = (model.states(told, tokens) - before).abs().amax((0, 3))  # (n + 1, L)
    assert (changed[:, 1] > 1e-4).all()
    assert (changed[:, [0, 2]] == 0).all()


def test_behind_a_level_token_frames_still_read_the_past_alone_and_the_prompt_in_force() -> None:
    torch.manual_seed(0)
    model = LevelToken(TOLD_BY_TOKEN).eval().requires_grad_(False)
    told, tokens = torch.cat([prompts(1), prompts(1) + 1], 1), columns(6)
    seam = torch.tensor([3])
    before = model.states(told, tokens, seam=seam)
    other = tokens.clone()
    other[:, 4] = (other[:, 4] + 1) % TINY.tokenizer.codes
    changed = (model.states(told, other, seam=seam) - before).abs().amax((0, 2, 3))
    assert (changed[:5] == 0).all()
    assert (changed[5:] > 1e-5).all()
    second = told.clone()
    second[:, 1] += 1
    changed = (model.states(second, tokens, seam=seam) - before).abs().amax((0, 2, 3))
    assert (changed[:3] == 0).all()  # frames 1 to 3 come before the steer
    assert (changed[3:] > 1e-5).all()


def test_a_level_token_is_in_place_of_the_embedding_beside_the_prompt() -> None:
    level = LevelToken(TOLD_BY_TOKEN).prompt.level.weight
    assert not level.any()
    assert not level.requires_grad  # it stays so in training


def test_a_bundle_says_that_its_level_is_a_token_and_others_say_nothing_of_it(generator: Generator) -> None:
    saved = generator.bundle.manifest.parameters
    assert saved["transformer"]["level_token"] is True
    assert MOGOConfig.from_dict(saved) == TOLD_BY_TOKEN
    assert "level_token" not in FLAT.to_dict()["transformer"]  # earlier releases read them
    assert isinstance(generator.transformer, LevelToken)


def test_one_sequence_for_all_levels_has_no_level_token() -> None:
    with pytest.raises(InvalidInput, match="no level to name"):
        replace(TINY, transformer=replace(TINY.transformer, joint=True, level_token=True))


@pytest.mark.parametrize("guidance", [1.0, 2.5])
def test_a_motion_is_the_same_in_any_batch(generator: Generator, guidance: float) -> None:
    settings = SamplingSettings(guidance=guidance)
    requests = [Request(text_features(k, k + 1), seed=k, frames=16 + k) for k in range(8)]
    together = generator.generate(requests, settings)
    for request, made in zip(requests, together, strict=True):
        (alone,) = generator.generate([request], settings)
        assert made is not None
        assert alone is not None
        assert made.tokens.shape == (TINY.tokenizer.levels, request.frames)
        assert np.array_equal(alone.tokens, made.tokens)
        assert np.array_equal(alone.features, made.features)


def test_a_motion_of_the_longest_training_length_is_drawn_from_the_whole_of_it() -> None:
    """With the widest window each frame is drawn as in training: the prompt is one position further than the frames
    are many."""
    model, tokens = transformer(TOLD_BY_TOKEN), columns(TINY.max_frames)
    assert model.farthest == TINY.max_frames + 1
    whole = model(prompts(1), tokens)[0]
    streams = opened(model, 1, replace(TINY.inference, window=TINY.max_frames))
    streams.start(prompts(1)[0, 0], 1)
    for frame in range(TINY.max_frames + 1):
        found = model.score(streams.states())[0]
        torch.testing.assert_close(found, whole[:, frame], atol=1e-5, rtol=0)
        if frame < TINY.max_frames:
            streams.accept(tokens[:, frame])


def test_motions_may_be_longer_than_those_of_the_training(tmp_path: Path) -> None:
    config = replace(TOLD_BY_TOKEN, longest_frames=70)
    long = Generator.load(random_bundle(tmp_path / "long", config), device="cpu", threads=1)
    (made,) = long.generate([Request(text_features(0), 1, 70)])
    assert made is not None
    assert made.features.shape[0] == 70
    assert np.isfinite(made.features).all()


def test_a_live_session_draws_the_tokens_of_the_whole_motion(generator: Generator) -> None:
    pool = LiveSessionPool(generator, 2)
    session = pool.start(text_features(0), 3)
    pool.start(text_features(1), 4)
    tokens = np.stack([pool.step()[session].tokens for _ in range(20)], 1)
    (made,) = generator.generate([Request(text_features(0), 3, 20)])
    assert made is not None
    assert np.array_equal(tokens, made.tokens)


def test_memory_of_training_counts_the_token() -> None:
    plain, told = (memory_model(config, bf16=False).carried or 0.0 for config in (FLAT, TOLD_BY_TOKEN))
    assert told - plain == 4 * TINY.tokenizer.levels * TINY.transformer.width
