"""The TMR-style networks: what they read, and what must never change an embedding."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from marey.core.errors import InvalidInput
from marey.evaluator.config import CONFIGS, STARTER, TINY, EvaluatorConfig
from marey.evaluator.model import TMR, Gaussian, MotionDecoder, MotionEncoder, SentenceEncoder

FRAMES = [21, 34, 48]
WORDS = [3, 11, 7]


@pytest.fixture(scope="module")
def motion() -> MotionEncoder:
    torch.manual_seed(0)
    encoder = MotionEncoder(TINY).eval().requires_grad_(False)
    encoder.mean.normal_()
    encoder.std.uniform_(0.5, 2)
    return encoder


@pytest.fixture(scope="module")
def text() -> SentenceEncoder:
    torch.manual_seed(1)
    return SentenceEncoder(TINY).eval().requires_grad_(False)


def batch(width: int, lengths: list[int], seed: int = 2) -> tuple[torch.Tensor, torch.Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(len(lengths), max(lengths), width, generator=generator), torch.tensor(lengths)


@pytest.mark.parametrize("garbage", [0.0, 1e6, float("nan")])
@pytest.mark.parametrize("more", [0, 1, 30])
def test_what_lies_beyond_a_motion_never_changes_its_embedding(
    motion: MotionEncoder, garbage: float, more: int
) -> None:
    features, lengths = batch(TINY.features, FRAMES)
    alone = torch.cat([motion.embed(features[i : i + 1, :n], lengths[i : i + 1]) for i, n in enumerate(FRAMES)])
    padded = torch.full((len(FRAMES), max(FRAMES) + more, TINY.features), garbage)
    for row, size in enumerate(FRAMES):
        padded[row, :size] = features[row, :size]
    torch.testing.assert_close(motion.embed(padded, lengths), alone, atol=1e-5, rtol=0)


@pytest.mark.parametrize("garbage", [0.0, 1e6, float("nan")])
def test_what_lies_beyond_a_sentence_never_changes_its_embedding(text: SentenceEncoder, garbage: float) -> None:
    states, lengths = batch(TINY.text_width, WORDS)
    alone = torch.cat([text.embed(states[i : i + 1, :n], lengths[i : i + 1]) for i, n in enumerate(WORDS)])
    padded = torch.full((len(WORDS), max(WORDS) + 5, TINY.text_width), garbage)
    for row, size in enumerate(WORDS):
        padded[row, :size] = states[row, :size]
    torch.testing.assert_close(text.embed(padded, lengths), alone, atol=1e-5, rtol=0)


def test_each_frame_is_read_also_those_of_a_last_token_that_is_not_full(motion: MotionEncoder) -> None:
    features, lengths = batch(TINY.features, [21])
    before = motion.embed(features, lengths)
    for frame in (0, 7, 19, 20):
        changed = features.clone()
        changed[0, frame, 10] += 3
        assert (motion.embed(changed, lengths) - before).abs().max() > 1e-4, frame


def test_of_a_frame_the_root_and_the_positions_are_read_and_nothing_else(motion: MotionEncoder) -> None:
    features, lengths = batch(TINY.features, [24])
    before = motion.embed(features, lengths)
    for number in range(0, TINY.features, 6):
        changed = features.clone()
        changed[:, :, number] += 5
        moved = float((motion.embed(changed, lengths) - before).abs().max())
        assert (moved > 1e-4) == (number < 67), number


def test_features_are_normalised_with_the_evaluators_own_statistics(motion: MotionEncoder) -> None:
    features, lengths = batch(TINY.features, [24])
    plain = MotionEncoder(TINY).eval().requires_grad_(False)
    plain.load_state_dict({**motion.state_dict(), "mean": torch.zeros(263), "std": torch.ones(263)})
    assert (plain.embed(features, lengths) - motion.embed(features, lengths)).abs().max() > 1e-2
    torch.testing.assert_close(
        plain.embed((features - motion.mean) / motion.std, lengths), motion.embed(features, lengths)
    )


def test_the_mean_alone_is_the_mean_of_the_distribution(motion: MotionEncoder, text: SentenceEncoder) -> None:
    features, lengths = batch(TINY.features, FRAMES)
    torch.testing.assert_close(motion.embed(features, lengths), motion(features, lengths).mean)
    states, words = batch(TINY.text_width, WORDS)
    torch.testing.assert_close(text.embed(states, words), text(states, words).mean)


def test_the_order_of_words_and_of_frames_matters(motion: MotionEncoder, text: SentenceEncoder) -> None:
    states, words = batch(TINY.text_width, [6])
    assert (text.embed(states.flip(1), words) - text.embed(states, words)).abs().max() > 1e-3
    features, lengths = batch(TINY.features, [24])
    assert (motion.embed(features.flip(1), lengths) - motion.embed(features, lengths)).abs().max() > 1e-3


def test_samples_scatter_about_the_mean_by_the_log_variance() -> None:
    torch.manual_seed(0)
    drawn = Gaussian(torch.full((20000, 1), 3.0), torch.full((20000, 1), 1.0)).sample()
    assert float(drawn.mean()) == pytest.approx(3, abs=0.05)
    assert float(drawn.var()) == pytest.approx(2.718, abs=0.1)


def test_the_decoder_gives_each_motion_its_frames_whatever_it_is_decoded_beside() -> None:
    torch.manual_seed(0)
    decoder = MotionDecoder(TINY).eval().requires_grad_(False)
    latents = torch.randn(2, TINY.network.width)
    both = decoder(latents, torch.tensor([21, 48]))
    assert both.shape == (2, 48, 67)
    alone = decoder(latents[:1], torch.tensor([21]))
    assert alone.shape == (1, 24, 67)
    torch.testing.assert_close(both[:1, :21], alone[:, :21], atol=1e-5, rtol=0)
    assert (both[0, :21] - both[1, :21]).abs().max() > 1e-3


def test_the_starters_encoders_take_less_than_five_megabytes_in_half_precision() -> None:
    networks = TMR(STARTER)
    shipped = [*networks.motion.state_dict().values(), *networks.text.state_dict().values()]
    assert sum(2 * value.numel() for value in shipped) < 5e6


@pytest.mark.parametrize("name", CONFIGS)
def test_a_configuration_survives_its_manifest(name: str) -> None:
    assert EvaluatorConfig.from_dict(CONFIGS[name].to_dict()) == CONFIGS[name]


def test_a_configuration_that_contradicts_its_layout_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"does not fit kit-251: 251 numbers at 12\.5 fps"):
        replace(TINY, layout="kit-251")
    with pytest.raises(InvalidInput, match="does not fit"):
        replace(TINY, inputs=300)
