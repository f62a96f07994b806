"""Scales, the quantizer with one codebook, and clips of any length in any batch."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F

from marey.models.momaskpp.config import TINY, Layout, MoMaskPPConfig
from marey.models.momaskpp.scales import Scales, enlarging, shrinking
from marey.models.momaskpp.tokenizer import Tokenizer, build_tokenizer

LENGTHS = torch.arange(1, 50)


def config(layout: Layout) -> MoMaskPPConfig:
    return replace(TINY, tokenizer=replace(TINY.tokenizer, layout=layout))


def tokenizer(layout: Layout = "own") -> Tokenizer:
    torch.manual_seed(0)
    model = Tokenizer(config(layout)).eval()
    model.quantizer.codebooks.normal_()
    return model


@pytest.mark.parametrize("divisor", [1, 2, 4, 8])
def test_resampling_is_area_and_linear_interpolation_over_each_clips_own_length(divisor: int) -> None:
    torch.manual_seed(0)
    vectors = torch.randn(len(LENGTHS), 49, 3)
    positions = (LENGTHS // divisor).clamp(min=1)
    small = shrinking(LENGTHS, positions, 49, 49 // divisor) @ vectors
    large = enlarging(LENGTHS, positions, 49, 49 // divisor) @ small
    for row, (n, h) in enumerate(zip(LENGTHS.tolist(), positions.tolist(), strict=True)):
        own = vectors[row : row + 1, :n].transpose(1, 2)
        shrunk = F.interpolate(own, size=h, mode="area")
        assert torch.allclose(small[row, :h], shrunk[0].T, atol=1e-6)
        enlarged = F.interpolate(shrunk, size=n, mode="linear", align_corners=False)
        assert torch.allclose(large[row, :n], enlarged[0].T, atol=1e-5)
        assert not small[row, h:].any()
        assert not large[row, n:].any()


def test_a_short_clip_has_a_token_at_every_scale_unless_padded() -> None:
    seven = torch.tensor([7])
    counts = {
        layout: [int(Scales((8, 4, 2, 1), layout, 49).counts(seven, scale)) for scale in range(4)]
        for layout in ("own", "padded")
    }
    assert counts == {"own": [1, 1, 3, 7], "padded": [0, 1, 3, 7]}
    assert Scales((8, 4, 2, 1), "padded", 49).widths == (6, 12, 24, 49)
    assert Scales((8, 4, 2, 1), "own", 49).total(49) == 91


@torch.no_grad()
def test_tokens_and_features_of_a_clip_do_not_depend_on_its_batch() -> None:
    model = tokenizer()
    lengths = torch.tensor([4, 28, 100, 196])
    features = torch.randn(4, 196, 263)
    tokens = model.encode(features, lengths)
    decoded = model.decode(tokens, lengths // 4)
    assert tokens.shape == (4, 91, 1)
    assert decoded.shape == (4, 196, 263)
    for row, frames in enumerate(lengths.tolist()):
        alone = model.encode(features[row : row + 1, :frames], lengths[row : row + 1])
        assert torch.equal(alone[0], tokens[row])
        own = model.decode(alone, lengths[row : row + 1] // 4)
        assert torch.allclose(own[0], decoded[row, :frames], atol=1e-4)
        assert not decoded[row, frames:].any()


@torch.no_grad()
def test_a_padded_clip_reads_the_padding_behind_its_end_and_another_layout_reads_none() -> None:
    lengths, features = torch.tensor([60]), torch.randn(1, 60, 263)
    own, padded = tokenizer("own"), tokenizer("padded")
    padded.load_state_dict(own.state_dict())
    assert padded.latents(features, lengths)[0].shape[1] == 49
    assert own.latents(features, lengths)[0].shape[1] == 15
    tokens = padded.encode(features, lengths)
    assert [int((block >= 0).sum()) for block in padded.scales.split(tokens[..., 0])] == [1, 3, 7, 15]
    assert padded.decode(tokens, lengths // 4).shape == (1, 60, 263)


@torch.no_grad()
def test_each_scale_leaves_less_of_the_latents() -> None:
    model = tokenizer()
    latent, lengths = torch.randn(8, 1, 16).repeat(1, 49, 1), torch.full((8,), 49)
    model.quantizer.codebooks.mul_(0.3)
    model.quantizer.codebooks[0, 0] = 0  # a code that changes nothing
    index = model.quantizer.indices(latent, lengths)
    errors = []
    for scales in range(5):
        kept = index.clone()
        for block in model.scales.split(kept)[scales:]:
            block.fill_(-1)
        left = latent - model.quantizer.vectors(kept, lengths, 49)
        errors.append(float(left.square().mean()))
    assert errors == sorted(errors, reverse=True)
    assert len(set(errors)) == 5


def test_training_fills_the_codebook_from_the_first_batch_and_moves_it() -> None:
    torch.manual_seed(0)
    model = Tokenizer(TINY).train()
    features, lengths = torch.randn(8, 64, 263), torch.tensor([64, 64, 64, 64, 40, 40, 32, 32])
    output, quantized = model(features, lengths)
    first = model.codebooks.clone()
    assert bool(model.quantizer.initialized)
    assert first.std() > 0
    assert output.shape == features.shape
    assert quantized.tokens.shape == (8, 91, 1)
    (output.square().mean() + quantized.commitment).backward()
    gradients = [p.grad for p in model.encoder.parameters()]
    assert all(g is not None and bool(g.abs().sum() > 0) for g in gradients)
    model(features, lengths)
    assert not torch.equal(first, model.codebooks)


def test_codes_are_drawn_by_distance_in_training_where_a_temperature_is_set() -> None:
    model = tokenizer()
    latent, lengths = torch.randn(2, 49, 16) * 0.01, torch.tensor([49, 49])
    model.train()
    model.quantizer.initialized.fill_(True)
    model.quantizer.temperature = 50.0
    drawn = [model.quantizer.indices(latent, lengths) for _ in range(2)]
    model.quantizer.temperature = 0.0
    nearest = [model.quantizer.indices(latent, lengths) for _ in range(2)]
    assert not torch.equal(*drawn)
    assert torch.equal(*nearest)


def test_a_tokenizer_is_built_from_a_manifests_parameters() -> None:
    assert build_tokenizer(TINY.to_dict()).scales == Scales.of(TINY)


def test_without_lengths_all_clips_have_the_longest() -> None:
    for layout in ("own", "padded"):
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, layout=layout))
        tokenizer = Tokenizer(config).eval()
        tokenizer.quantizer.codebooks.normal_()
        features = torch.randn(2, config.max_frames, 263)
        longest = torch.full((2,), config.max_frames)
        tokens = tokenizer.encode(features)
        assert torch.equal(tokens, tokenizer.encode(features, longest))
        found = tokenizer.decode(tokens)
        assert found.shape == features.shape
        assert torch.equal(found, tokenizer.decode(tokens, longest // tokenizer.frames_per_token))
