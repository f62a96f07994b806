"""Transformer blocks, averages of weights."""

from __future__ import annotations

import math

import pytest
import torch
from torch import nn

from marey.nn.ema import WeightAverage, update_average, warm_momentum
from marey.nn.ragged import pad_length
from marey.nn.transformer import Transformer, dropout, sinusoidal_positions
from tests.support.processors import PACKED_TYPES, on_a_gpu


def transformer(*, norm_first: bool = True) -> Transformer:
    torch.manual_seed(0)
    return Transformer(2, 32, 4, 64, 0.1, norm_first=norm_first).eval()


@pytest.mark.parametrize("norm_first", [True, False])
@torch.inference_mode()
def test_what_may_not_be_read_changes_nothing(norm_first: bool) -> None:
    model = transformer(norm_first=norm_first)
    x = torch.randn(2, 16, 32)
    valid = torch.arange(16)[None] < torch.tensor([[5], [16]])
    other = x.clone()
    other[0, 5:] = 100.0
    assert torch.equal(model(x, valid)[0, :5], model(other, valid)[0, :5])


@torch.inference_mode()
def test_more_padding_and_another_batch_change_no_bit() -> None:
    model = transformer()
    x = torch.randn(3, 48, 32)
    valid = torch.arange(48)[None] < torch.tensor([[7], [16], [13]])
    whole = model(x, valid)
    cut = model(x[:, :16], valid[:, :16])
    alone = model(x[2:, :32], valid[2:, :32])
    for row, size in enumerate((7, 16, 13)):
        assert torch.equal(whole[row, :size], cut[row, :size])
    assert torch.equal(whole[2, :13], alone[0, :13])


@torch.inference_mode()
@pytest.mark.parametrize("dtype", PACKED_TYPES)
def test_more_padding_and_another_batch_change_no_bit_after_packing(dtype: torch.dtype) -> None:
    model = transformer()
    model.prepare_inference(dtype)
    x = torch.randn(3, 48, 32)
    valid = torch.arange(48)[None] < torch.tensor([[23], [24], [13]])
    whole = model(x, valid)
    cut = model(x[:, :24], valid[:, :24])
    alone = model(x[2:, :32], valid[2:, :32])
    wanted = model(x[:, :24], valid[:, :24], 16)
    for row, size in enumerate((23, 24, 13)):
        assert torch.equal(whole[row, :size], cut[row, :size])
        assert torch.equal(whole[row, :16], wanted[row, :16]) or size < 16
    assert torch.equal(whole[2, :13], alone[0, :13])


@pytest.mark.parametrize("norm_first", [True, False])
@torch.inference_mode()
def test_rows_without_padding_equal_padded_ones(norm_first: bool) -> None:
    model = transformer(norm_first=norm_first)
    x, valid = torch.randn(4, 21, 32), torch.rand(4, 21) < 0.6
    valid[:, 3] = True
    padded = model(x, valid, 9)
    model.prepare_inference(torch.float32)
    assert model.packed
    exists = valid[:, :9]
    torch.testing.assert_close(model(x, valid, 9)[exists], padded[exists], atol=1e-5, rtol=1e-5)


@torch.inference_mode()
def test_post_norm_equals_the_reference_encoder_layer_of_torch() -> None:
    model = transformer(norm_first=False)
    x = torch.randn(2, 9, 32)
    valid = torch.arange(9)[None] < torch.tensor([[9], [6]])
    expected = x
    for block in model.blocks:
        layer = nn.TransformerEncoderLayer(32, 4, 64, 0.1, "gelu", batch_first=True).eval()
        layer.self_attn.in_proj_weight.copy_(block.attention.qkv.weight)
        layer.self_attn.in_proj_bias.copy_(block.attention.qkv.bias)
        layer.self_attn.out_proj.load_state_dict(block.attention.out.state_dict())
        layer.linear1.load_state_dict(block.wide.state_dict())
        layer.linear2.load_state_dict(block.narrow.state_dict())
        layer.norm1.load_state_dict(block.norm1.state_dict())
        layer.norm2.load_state_dict(block.norm2.state_dict())
        expected = layer(expected, src_key_padding_mask=~valid)
    found = model(x, valid)
    torch.testing.assert_close(found[0], expected[0], atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(found[1, :6], expected[1, :6], atol=1e-5, rtol=1e-5)


def test_attention_in_training_equals_that_of_inference() -> None:
    model = Transformer(2, 32, 4, 64, 0.0, norm_first=True)
    x, valid = torch.randn(2, 16, 32), torch.arange(16)[None] < torch.tensor([[5], [16]])
    for row, size in enumerate((5, 16)):
        torch.testing.assert_close(model.train()(x, valid)[row, :size], model.eval()(x, valid)[row, :size])


@pytest.mark.gpu
@on_a_gpu
@pytest.mark.parametrize(("width", "heads", "size"), [(256, 4, 80), (256, 4, 139), (192, 4, 64)])
@pytest.mark.parametrize("bf16", [False, True])
def test_gradients_on_a_gpu_are_those_of_the_processor(width: int, heads: int, size: int, bf16: bool) -> None:
    """The fused attention of a GPU, with masks of each sequence and the first rows of the output alone."""
    torch.manual_seed(0)
    model = Transformer(2, width, heads, 2 * width, 0.0, norm_first=True).train()
    x, wanted = torch.randn(2, 16, size, width)
    valid = torch.arange(size) < torch.randint(size // 2, size + 1, (16, 1))

    def gradients(device: str) -> dict[str, torch.Tensor]:
        there = Transformer(2, width, heads, 2 * width, 0.0, norm_first=True).train().to(device)
        there.load_state_dict(model.state_dict())
        with torch.autocast(device, torch.bfloat16, enabled=bf16 and device == "cuda"):
            found = there(x.to(device), valid.to(device), size - 10)
        (found * wanted[:, : size - 10].to(device)).mean().backward()
        return {name: each.grad.cpu() for name, each in there.named_parameters() if each.grad is not None}

    here, there = gradients("cpu"), gradients("cuda")
    for name, gradient in here.items():
        error = (there[name] - gradient).norm() / gradient.norm()
        assert error < (0.05 if bf16 else 1e-3), f"{name}: {error:.3g}"


def test_dropout_zeroes_its_share_and_keeps_the_mean() -> None:
    torch.manual_seed(0)
    x = torch.ones(1000, 103)
    dropped = dropout(x, 0.25, training=True)
    assert float((dropped == 0).float().mean()) == pytest.approx(0.25, abs=0.005)
    assert float(dropped.mean()) == pytest.approx(1.0, abs=0.01)
    assert dropped.unique().tolist() == pytest.approx([0.0, 4 / 3])
    assert dropout(x, 0.25, training=False) is x


def test_positions_are_sines_and_cosines() -> None:
    table = sinusoidal_positions(10, 8)
    assert table.shape == (10, 8)
    assert float(table[3, 0]) == pytest.approx(math.sin(3))
    assert float(table[3, 1]) == pytest.approx(math.cos(3))
    assert float(table[3, 4]) == pytest.approx(math.sin(3 / 10000 ** (4 / 8)))


def test_pad_length_is_the_next_multiple_of_16() -> None:
    assert [pad_length(n) for n in (1, 16, 17, 62)] == [16, 16, 32, 64]


def test_momentum_starts_low() -> None:
    assert warm_momentum(0.999, 0) == 0.1
    assert warm_momentum(0.999, 90) == pytest.approx(0.91)
    assert warm_momentum(0.999, 10**6) == 0.999


def test_an_average_moves_by_its_momentum_and_copies_buffers() -> None:
    average, source = nn.BatchNorm1d(3), nn.BatchNorm1d(3)
    source.weight.data.fill_(3.0)
    source.running_mean.fill_(7.0)
    update_average(average, source, 0.75)
    assert average.weight.tolist() == [1.5] * 3
    assert average.running_mean.tolist() == [7.0] * 3


def test_averaged_weights_are_swapped_in_and_out() -> None:
    model = nn.Linear(2, 1)
    average = WeightAverage(model, 0.5)
    before = model.weight.detach().clone()
    model.weight.data.add_(1.0)
    average.update(10**6)
    with average.applied():
        torch.testing.assert_close(model.weight, before + 0.5)
    torch.testing.assert_close(model.weight, before + 1.0)
    average.assign()
    torch.testing.assert_close(model.weight, before + 0.5)


def test_norms_stand_behind_unless_asked_for_in_front() -> None:
    assert [block.norm_first for block in Transformer(1, 8, 2, 16, 0.0).blocks] == [False]
    assert [block.norm_first for block in Transformer(1, 8, 2, 16, 0.0, norm_first=True).blocks] == [True]
