"""Blocks that also read a text: both orders of their norms, with and without padding."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from marey.models.momaskpp.attention import CrossTransformer
from marey.models.momaskpp.config import TINY
from marey.nn.batch_threads import CALLING_THREAD
from marey.nn.ragged import ROWS
from tests.support.processors import PACKED_TYPES

WIDTH = TINY.masked.width
LENGTHS, WORDS = (5, 21, 40), (1, 7, 4)


def transformer(*, norm_first: bool) -> CrossTransformer:
    torch.manual_seed(0)
    model = CrossTransformer(replace(TINY.masked, norm_first=norm_first)).eval().requires_grad_(False)
    for parameter in model.parameters():
        parameter.add_(0.1 * torch.randn_like(parameter))
    return model


def inputs() -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Tokens and words of three sequences, and which of them exist."""
    torch.manual_seed(1)
    valid = torch.arange(max(LENGTHS)) < torch.tensor(LENGTHS)[:, None]
    present = torch.arange(max(WORDS)) < torch.tensor(WORDS)[:, None]
    return torch.randn(3, max(LENGTHS), WIDTH), valid, torch.randn(3, max(WORDS), WIDTH), present


@pytest.mark.parametrize("norm_first", [True, False])
@pytest.mark.parametrize("packed", [True, False])
@torch.inference_mode()
def test_tokens_and_words_that_do_not_exist_change_nothing_and_the_others_do(norm_first: bool, packed: bool) -> None:
    model = transformer(norm_first=norm_first)
    if packed:
        model.prepare_inference(torch.float32, CALLING_THREAD)
    x, valid, words, present = inputs()
    found = model(x, valid, words, present)
    hidden = model(torch.where(valid[..., None], x, 9.0), valid, torch.where(present[..., None], words, 9.0), present)
    assert torch.equal(found[valid], hidden[valid])
    for other in (model(x, valid, -words, present), model(-x, valid, words, present)):
        assert not torch.allclose(found[valid], other[valid], atol=1e-2)
    fewer = model(x, valid, words, present & (torch.arange(max(WORDS)) < 3))
    same = torch.equal(found[0, : LENGTHS[0]], fewer[0, : LENGTHS[0]])
    assert (same, torch.allclose(found[1], fewer[1])) == (True, False)


@pytest.mark.parametrize("norm_first", [True, False])
@torch.inference_mode()
def test_a_block_is_attention_reading_and_feedforward_each_added_to_its_input(norm_first: bool) -> None:
    model = transformer(norm_first=norm_first)
    x, valid, words, present = inputs()
    expected = x
    for block in model.blocks:
        parts = (
            (block.norm1, lambda h, b=block: b.attention(h, valid[:, None, None])),
            (block.norm2, lambda h, b=block: b.cross(h, words, present)),
            (block.norm3, lambda h, b=block: b.narrow(nn.functional.gelu(b.wide(h)))),
        )
        for norm, part in parts:
            expected = expected + part(norm(expected)) if norm_first else norm(expected + part(expected))
    expected = model.norm(expected)
    assert isinstance(model.norm, nn.LayerNorm) is norm_first
    torch.testing.assert_close(model(x, valid, words, present)[valid], expected[valid], atol=1e-5, rtol=1e-5)


@torch.inference_mode()
def test_reading_equals_the_attention_of_torch() -> None:
    cross = transformer(norm_first=False).blocks[0].cross
    x, _, words, present = inputs()
    other = nn.MultiheadAttention(WIDTH, TINY.masked.heads, batch_first=True).eval()
    other.in_proj_weight.data.copy_(torch.cat([cross.query.weight, cross.memory.weight]))
    other.in_proj_bias.data.copy_(torch.cat([cross.query.bias, cross.memory.bias]))
    other.out_proj.load_state_dict(cross.out.state_dict())
    expected = other(x, words, words, key_padding_mask=~present)[0]
    torch.testing.assert_close(cross(x, words, present), expected, atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("norm_first", [True, False])
@pytest.mark.parametrize("dtype", PACKED_TYPES)
@torch.inference_mode()
def test_a_packed_network_computes_the_rows_that_exist_and_at_last_those_that_are_wanted(
    norm_first: bool, dtype: torch.dtype
) -> None:
    plain, model = transformer(norm_first=norm_first), transformer(norm_first=norm_first)
    model.prepare_inference(dtype, CALLING_THREAD)
    rows: list[int] = []
    for block in model.blocks:
        block.narrow.register_forward_hook(lambda _layer, given, _made: rows.append(len(given[0])))
    x, valid, words, present = inputs()
    wanted = valid & (torch.arange(max(LENGTHS)) % 7 == 3)
    found = model(x, valid, words, present, wanted)
    assert found.dtype == torch.float32
    assert found.shape == (int(wanted.sum()), WIDTH)
    there, asked = int(valid.sum()), int(wanted.sum())
    assert rows == [there + -there % ROWS] * (len(model.blocks) - 1) + [asked + -asked % ROWS]
    close = {"atol": 1e-5, "rtol": 1e-5} if dtype == torch.float32 else {"atol": 0.3, "rtol": 0.1}
    torch.testing.assert_close(found, plain(x, valid, words, present, wanted), **close)
    whole = model(x, valid, words, present)
    assert not whole[~valid].any()
    torch.testing.assert_close(whole[valid], plain(x, valid, words, present)[valid], **close)


def test_training_goes_through_all_rows_after_packing_too() -> None:
    """A packed network has no gradient: it computes as before where one is asked for."""
    model = transformer(norm_first=True)
    x, valid, words, present = inputs()
    expected = model(x, valid, words, present)
    torch.testing.assert_close(expected[valid], model(x.requires_grad_(), valid, words, present)[valid])
