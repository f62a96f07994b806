"""Linear layers packed for inference."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from marey.nn.packed import GroupedLinear, PackedLinear, pack_linears
from tests.support.processors import PACKED_TYPES, packs_bfloat16

pytestmark = pytest.mark.skipif(not torch.backends.mkldnn.is_available(), reason="this torch has no oneDNN")


@pytest.mark.parametrize("bias", [True, False])
def test_a_packed_layer_gives_the_same_outputs(bias: bool) -> None:
    linear, x = nn.Linear(512, 256, bias=bias), torch.randn(3, 5, 512)
    found = PackedLinear(linear)(x)
    assert found.shape == (3, 5, 256)
    torch.testing.assert_close(found, linear(x).detach(), atol=1e-5, rtol=0)


@pytest.mark.parametrize(("before", "after"), [(512, 256), (256, 513), (1024, 1024), (2048, 512)])
def test_the_bits_of_a_row_depend_neither_on_other_rows_nor_on_its_place(before: int, after: int) -> None:
    packed, x = PackedLinear(nn.Linear(before, after)), torch.randn(192, before)
    whole = packed(x)
    for rows in (1, 6, 12, 18, 96):
        for first in (0, 6, 66, 96):
            assert torch.equal(packed(x[first : first + rows]), whole[first : first + rows])


@pytest.mark.parametrize("dtype", PACKED_TYPES)
@pytest.mark.parametrize("group", [1, 4, 8])
@pytest.mark.parametrize(("before", "after", "rows"), [(192, 576, 1), (256, 513, 6), (1024, 1024, 6), (2048, 512, 12)])
def test_the_bits_of_a_session_depend_neither_on_those_beside_it_nor_on_its_place(
    before: int, after: int, rows: int, group: int, dtype: torch.dtype
) -> None:
    packed, x = GroupedLinear(nn.Linear(before, after), dtype, group=group), torch.randn(11, rows, before)
    whole = packed(x)
    for sessions in (1, 2, 4, 7, 8):
        for first in (0, 1, 3):
            assert torch.equal(packed(x[first : first + sessions]), whole[first : first + sessions])


@pytest.mark.parametrize("bias", [True, False])
@pytest.mark.parametrize(("before", "after"), [(64, 96), (1024, 1024)])
def test_a_grouped_layer_gives_the_same_outputs(before: int, after: int, bias: bool) -> None:
    linear, x = nn.Linear(before, after, bias=bias), torch.randn(5, 6, before)
    packed = GroupedLinear(linear, group=2)
    torch.testing.assert_close(packed(x), linear(x).detach(), atol=1e-5, rtol=0)
    torch.testing.assert_close(packed(x[0]), linear(x[0]).detach(), atol=1e-5, rtol=0)


@packs_bfloat16
def test_bfloat16_weights_round_and_nothing_else() -> None:
    linear, x = nn.Linear(512, 256), torch.randn(50, 512)
    found = PackedLinear(linear, torch.bfloat16)(x)
    assert found.dtype == torch.float32
    torch.testing.assert_close(found, linear(x).detach(), atol=0.03, rtol=0)


def test_every_linear_layer_of_a_module_is_replaced_and_nothing_else() -> None:
    inner = nn.Sequential(nn.Linear(4, 6), nn.LayerNorm(6))
    module = nn.Sequential(inner, nn.GELU(), nn.Linear(6, 2)).requires_grad_(False)
    x = torch.randn(7, 4)
    expected = module(x)
    pack_linears(module)
    kinds = [type(part).__name__ for part in module.modules()]
    assert kinds == ["Sequential", "Sequential", "PackedLinear", "LayerNorm", "GELU", "PackedLinear"]
    torch.testing.assert_close(module(x), expected)


@pytest.mark.parametrize("shape", [(512,), (1, 512), (1, 1, 512)])
def test_a_row_alone_gives_the_bits_that_it_gives_among_others(shape: tuple[int, ...]) -> None:
    packed, rows = PackedLinear(nn.Linear(512, 96)), torch.randn(4, 512)
    found = packed(rows[2].reshape(shape))
    assert found.shape == (*shape[:-1], 96)
    assert torch.equal(found.reshape(-1), packed(rows)[2])
