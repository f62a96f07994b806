"""Rollouts: motions of the model in training, one of each given clip's captions."""

from __future__ import annotations

import pytest
import torch

from marey.data.prepared import PreparedData
from marey.models.mogo import rollouts
from marey.models.mogo.config import TINY
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.rollouts import LEAST, Rollout, Rollouts
from marey.models.mogo.streaming import StreamBatch
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.sentences import SentenceData
from marey.training.texts import CaptionTexts

from .networks import transformer

CLIPS = [3, 0, 7, 3]
MOST = 20


@pytest.fixture(scope="module")
def model() -> RQHCTransformer:
    return transformer()


@pytest.fixture(scope="module")
def tokenizer() -> Tokenizer:
    torch.manual_seed(0)
    made = Tokenizer(TINY).eval()
    made.quantizer.codebooks.normal_()
    return made


@pytest.fixture(scope="module")
def captions(prepared: PreparedData) -> SentenceData:
    texts = CaptionTexts.load(prepared)
    return SentenceData.of_sentences(texts, prepared.caption_counts, 384, torch.device("cpu"))


@pytest.fixture(scope="module")
def drawn(model: RQHCTransformer, tokenizer: Tokenizer, captions: SentenceData) -> list[Rollout]:
    return list(Rollouts(model, tokenizer, captions).draw(CLIPS, MOST))


def alone(packed: PackedModel, sentence: torch.Tensor, seed: int, frames: int) -> torch.Tensor:
    """Frames that a stream draws under one prompt."""
    streams = StreamBatch(packed, 1)
    session = streams.start(sentence, seed, lasts=packed.network.natural_frames(sentence[None]))
    return torch.stack([streams.step()[session] for _ in range(frames)])


@torch.inference_mode()
def test_a_rollout_is_a_stream_of_its_clips_prompt(
    model: RQHCTransformer, captions: SentenceData, drawn: list[Rollout]
) -> None:
    assert sorted(rollout.clip for rollout in drawn) == sorted(CLIPS)
    packed, seeds = PackedModel(model), set[int]()
    for rollout in drawn:
        found = [
            seed
            for seed, clip in enumerate(CLIPS)
            for sentence in captions.sentences(captions.captions_of([clip]))
            if clip == rollout.clip and torch.equal(alone(packed, sentence, seed, len(rollout.tokens)), rollout.tokens)
        ]
        seeds.update(found[:1])
    assert seeds == set(range(len(CLIPS)))


def test_rollouts_have_different_lengths_and_come_as_they_finish(drawn: list[Rollout]) -> None:
    lengths = [len(rollout.tokens) for rollout in drawn]
    assert lengths == sorted(lengths)
    assert LEAST <= lengths[0] < lengths[-1] <= MOST


def test_a_rollout_is_no_longer_than_asked(
    model: RQHCTransformer, tokenizer: Tokenizer, captions: SentenceData
) -> None:
    short = list(Rollouts(model, tokenizer, captions).draw(CLIPS, 5))
    assert [len(rollout.tokens) for rollout in short] == [5] * len(CLIPS)


@torch.inference_mode()
def test_features_are_those_of_the_tokens(tokenizer: Tokenizer, drawn: list[Rollout]) -> None:
    for rollout in drawn:
        torch.testing.assert_close(torch.from_numpy(rollout.features), tokenizer.decode(rollout.tokens[None])[0])


def test_more_clips_than_sessions_give_the_same_rollouts(
    model: RQHCTransformer,
    tokenizer: Tokenizer,
    captions: SentenceData,
    drawn: list[Rollout],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rollouts, "SESSIONS", 2)
    again = list(Rollouts(model, tokenizer, captions).draw(CLIPS, MOST))
    tokens = [rollout.tokens for rollout in again]
    assert len(tokens) == len(drawn)
    assert all(any(torch.equal(rollout.tokens, each) for each in tokens) for rollout in drawn)


def test_a_seed_draws_the_same_rollouts_and_another_draws_others(
    model: RQHCTransformer, tokenizer: Tokenizer, captions: SentenceData, drawn: list[Rollout]
) -> None:
    for seed in (0, 1):
        again = list(Rollouts(model, tokenizer, captions, seed).draw(CLIPS, MOST))
        same = all(torch.equal(a.tokens, b.tokens) for a, b in zip(drawn, again, strict=True))
        assert same == (seed == 0)
