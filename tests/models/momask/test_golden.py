"""The networks give the numbers that MoMask's public classes gave, with the same weights: at full size, 1e-4."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from marey.importing import Section
from marey.models.momask import names
from marey.models.momask.config import InferenceConfig, MoMaskConfig
from marey.models.momask.decoding import Items, decode_base, decode_residual
from marey.models.momask.model import LengthEstimator, MaskedTransformer, ResidualTransformer
from marey.models.momask.tokenizer import Tokenizer
from marey.nn.convolution import frame_mask
from tests.models.momask.public import (
    GOLDEN,
    Shapes,
    length_shapes,
    masked_shapes,
    normals,
    residual_shapes,
    rvq_shapes,
    weights,
)
from tests.support.golden import assert_golden

CONFIG = MoMaskConfig()
LENGTHS = torch.tensor([49, 25])
VALID = frame_mask(LENGTHS, 49)
ARGMAX = InferenceConfig(temperature=0.0, residual_temperature=0.0)


def filled(network: nn.Module, parts: names.PartNames, shapes: Shapes) -> Any:
    """The network with the weights of the golden numbers."""
    section = Section("golden", "", weights(shapes))
    parts.fill(network, section)
    assert section.unknown == ()
    return network


def residual(shared: bool) -> ResidualTransformer:
    config = MoMaskConfig(shared=shared)
    return filled(ResidualTransformer(config), names.residual_names(config), residual_shapes(shared=shared))


@pytest.fixture(scope="module")
def tokenizer() -> Tokenizer:
    return filled(Tokenizer(CONFIG), names.tokenizer_names(CONFIG), rvq_shapes())


@pytest.fixture(scope="module")
def masked() -> MaskedTransformer:
    return filled(MaskedTransformer(CONFIG), names.masked_names(CONFIG), masked_shapes())


def as_public(logits: Tensor) -> Tensor:
    """Logits (B, n, K) as the golden file has them: (B, K, n), zero where there is no token."""
    return (logits * VALID[..., None]).transpose(1, 2)


def test_names_and_shapes_are_those_of_the_public_files() -> None:
    counts = [sum(int(np.prod(s)) for k, s in shapes.items() if k != "position_enc.pe") for shapes in (
        rvq_shapes(), masked_shapes(), residual_shapes(shared=True), residual_shapes(shared=False), length_shapes(),
    )]  # fmt: skip
    books = 6 * 512 * 512  # buffers
    assert counts == [19_436_807 + books, 12_048_768, 13_364_224, 14_417_926, 435_122]
    assert [len(rvq_shapes()), len(masked_shapes()), len(residual_shapes(shared=True))] == [72, 108, 112]


def test_by_default_the_residual_transformer_is_the_public_one() -> None:
    network = filled(ResidualTransformer(CONFIG), names.residual_names(CONFIG), residual_shapes(shared=True))
    assert network.shared


def test_the_tokenizer_encodes_and_decodes_as_the_public_one(tokenizer: Tokenizer) -> None:
    golden = GOLDEN["rvq"]
    features = normals(7, 2, 196, 263)
    latent = tokenizer.encoder(features.transpose(1, 2), None)
    assert_golden(latent, golden["enc"])
    tokens = tokenizer.encode(features)
    assert tokens[0, :3].tolist() == golden["idx0"]
    codes = torch.stack([tokenizer.codebooks[v][tokens[..., v]] for v in range(6)]).transpose(2, 3)
    assert_golden(codes, golden["codes"])
    assert_golden(tokenizer.decode(tokens), golden["dec"])
    tokens[1, 25:] = -1
    assert_golden(tokenizer.decode(tokens), golden["dec_pad"])


def test_the_masked_transformer_gives_the_public_logits(masked: MaskedTransformer) -> None:
    golden = GOLDEN["mask"]
    ids = torch.from_numpy(np.random.RandomState(11).randint(0, 512, (2, 49)))
    ids[:, ::3] = masked.mask_token
    sentence, null = masked.condition(normals(13, 2, 512)), masked.condition.null().expand(2, -1)
    assert_golden(as_public(masked(ids, VALID, sentence)), golden["cond"])
    assert_golden(as_public(masked(ids, VALID, null)), golden["uncond"])
    guided = masked(ids.repeat(2, 1), VALID.repeat(2, 1), torch.cat([sentence, null]), 4.0)
    assert_golden(as_public(guided), golden["cfg"])


@pytest.mark.parametrize("shared", [True, False])
def test_the_residual_transformer_gives_the_public_logits(shared: bool) -> None:
    network, golden = residual(shared), GOLDEN[f"res_sw_{shared}"]
    levels = torch.from_numpy(np.random.RandomState(12).randint(0, 512, (2, 49, 6)))
    levels = levels.masked_fill(~VALID[..., None], network.pad_token)
    sentence, null = network.condition(normals(13, 2, 512)), network.condition.null().expand(2, -1)
    for level in range(1, 6):
        total = torch.stack([network.embed(levels[..., v], v) for v in range(level)]).sum(0)
        if level < 5:
            logits = network(total, VALID, level, sentence)
        else:
            both = torch.cat([sentence, null])
            logits = network(total.repeat(2, 1, 1), VALID.repeat(2, 1), level, both, 5.0)
        assert_golden(as_public(logits), golden[str(level)])


def test_the_length_estimator_gives_the_public_logits() -> None:
    network = filled(LengthEstimator(CONFIG), names.length_names(CONFIG), length_shapes())
    assert_golden(network(normals(13, 2, 512)), GOLDEN["len"])


def test_both_loops_give_the_public_tokens_with_the_likeliest_ones_drawn(masked: MaskedTransformer) -> None:
    network = residual(shared=True)
    text = normals(13, 2, 512)
    items = Items(
        lengths=LENGTHS,
        seeds=torch.zeros(2, dtype=torch.long),
        masked_sentence=masked.condition(text),
        residual_sentence=network.condition(text),
        tokens=torch.full((2, 49, 6), -1),
    )
    items = decode_base(masked, items, ARGMAX, lambda: None)
    assert_nearly_all_equal(items.tokens[..., 0], GOLDEN["gen_mask"])
    items = decode_residual(network, items, ARGMAX, lambda: None)
    assert_nearly_all_equal(items.tokens, GOLDEN["gen_res"])


def assert_nearly_all_equal(tokens: Tensor, golden: dict[str, Any]) -> None:
    """Compare tokens: with random weights a difference of rounding may swap two that are equally likely."""
    expected = torch.tensor(golden["ids"])
    assert int((tokens < 0).sum()) == golden["neg"]
    assert float((tokens == expected).float().mean()) > 0.95
