"""MoSA-VQ tokenizer: lengths, causality, frames in chunks."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from marey.models.mogo.config import TINY
from marey.models.mogo.tokenizer import CausalBlock, DecoderState, Tokenizer

LEVELS = TINY.tokenizer.levels


def tokenizer() -> Tokenizer:
    torch.manual_seed(0)
    made = Tokenizer(TINY).eval()
    made.quantizer.codebooks.normal_()
    made.set_statistics(torch.randn(TINY.features), torch.rand(TINY.features) + 0.5)
    for parameter in made.parameters():
        parameter.data.add_(0.05 * torch.randn_like(parameter))  # biases, scales: nothing at its start
    return made


def columns(frames: int, batch: int = 1) -> torch.Tensor:
    generator = torch.Generator().manual_seed(frames)
    return torch.randint(TINY.tokenizer.codes, (batch, frames, LEVELS), generator=generator)


def streamed(made: Tokenizer, tokens: torch.Tensor, chunk: int) -> torch.Tensor:
    state = made.decoder.start(len(tokens))
    frames: list[torch.Tensor] = []
    for part in tokens.split(chunk, dim=1):
        found, state = made.decode_next(part, state)
        frames.append(found)
    return torch.cat(frames, 1)


@pytest.mark.parametrize("chunk", [1, 3, 7, 40])
def test_frames_decoded_in_chunks_equal_those_of_the_whole_clip(chunk: int) -> None:
    made, tokens = tokenizer(), columns(40, 2)
    torch.testing.assert_close(streamed(made, tokens, chunk), made.decode(tokens), atol=1e-5, rtol=0)


@pytest.mark.parametrize("chunk", [1, 4])
def test_equal_chunks_give_equal_bits(chunk: int) -> None:
    made, tokens = tokenizer(), columns(24)
    assert torch.equal(streamed(made, tokens, chunk), streamed(made, tokens, chunk))


def test_a_stream_decodes_to_the_same_frames_beside_others() -> None:
    made, tokens = tokenizer(), columns(24, 5)
    together = streamed(made, tokens, 1)
    for row in range(5):
        torch.testing.assert_close(together[row], streamed(made, tokens[row : row + 1], 1)[0], atol=1e-5, rtol=0)


def test_the_decoder_never_looks_ahead() -> None:
    made, tokens = tokenizer(), columns(30)
    other = tokens.clone()
    other[:, 17:] = columns(13)
    first, second = made.decode(tokens), made.decode(other)
    torch.testing.assert_close(first[:, :17], second[:, :17], atol=1e-6, rtol=0)
    assert not torch.allclose(first[:, 17], second[:, 17])


def test_sessions_are_taken_out_of_a_decoder_state_and_joined_again() -> None:
    made, tokens = tokenizer(), columns(20, 3)
    _, state = made.decode_next(tokens[:, :10], made.decoder.start(3))
    order = torch.tensor([2, 0])
    joined = DecoderState.join([state.select(order[:1]), state.select(order[1:])])
    found, _ = made.decode_next(tokens[order, 10:], joined)
    torch.testing.assert_close(found, made.decode(tokens)[order, 10:], atol=1e-5, rtol=0)


def test_padding_changes_no_token_and_no_frame_of_a_clip() -> None:
    made = tokenizer()
    features = torch.randn(1, 21, TINY.features)
    alone = made.encode(features, torch.tensor([21]))
    padded = torch.cat([features, 9 * torch.randn(1, 11, TINY.features)], 1)
    beside = made.encode(padded, torch.tensor([21]))
    assert torch.equal(beside[:, :21], alone)
    assert (beside[:, 21:] == -1).all()
    frames = made.decode(beside, torch.tensor([21]))
    torch.testing.assert_close(frames[:, :21], made.decode(alone), atol=1e-5, rtol=0)
    assert not frames[:, 21:].any()


def test_what_lies_beyond_a_clip_is_zero_and_trains_nothing() -> None:
    made = tokenizer().train()
    made.quantizer.dropout = 0.0
    features = torch.randn(2, 24, TINY.features)
    features.requires_grad_(True)
    output, quantized = made(features, torch.tensor([24, 15]))
    assert not output[1, 15:].any()
    assert not quantized.output[1, 15:].any()
    (output.sum() + quantized.commitment).backward()
    assert features.grad is not None
    assert not features.grad[1, 15:].any()
    assert features.grad[1, :15].any()


def test_the_encoder_may_look_ahead() -> None:
    made = tokenizer()
    features = torch.randn(1, 24, TINY.features)
    later = features.clone()
    later[:, 12:] += 1
    latents = [made.encoder(x.transpose(1, 2), None) for x in (features, later)]
    assert not torch.allclose(latents[0][..., 11], latents[1][..., 11])


def test_the_quantizer_drops_levels_as_configured() -> None:
    config = replace(TINY, tokenizer=replace(TINY.tokenizer, level_dropout=0.37, decay=0.61))
    quantizer = Tokenizer(config).quantizer
    assert (quantizer.dropout, quantizer.decay) == (0.37, 0.61)


def test_nothing_is_dropped_outside_of_training() -> None:
    torch.manual_seed(0)
    block = CausalBlock(4, 1, 0.5).eval()
    x, past = torch.randn(1, 4, 6), torch.zeros(1, 4, 2)
    assert torch.equal(block(x, past)[0], block(x, past)[0])
    block.train()
    assert not torch.equal(block(x, past)[0], block(x, past)[0])
