"""Linear layers packed for inference."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from marey.nn.packed import (
    CastLinear,
    GroupedLinear,
    PackedLinear,
    SmallLinear,
    cast_linears,
    is_small,
    pack_linears,
    packed_gelu,
)
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


@pytest.mark.parametrize("dtype", PACKED_TYPES)
def test_matrices_that_stay_in_the_cache_are_not_packed_and_large_ones_are_in_the_type_asked_for(
    dtype: torch.dtype,
) -> None:
    """Of published sizes, 1024 numbers wide, every matrix is large; of those for two cores none is."""
    for before, after, small in ((192, 576, True), (256, 513, True), (1024, 1024, False), (4096, 1024, False)):
        grouped = GroupedLinear(nn.Linear(before, after), dtype)
        assert is_small(nn.Linear(before, after)) is small
        assert isinstance(grouped.product, SmallLinear if small else PackedLinear)
        assert isinstance(grouped.product, SmallLinear) or grouped.product.dtype == dtype
    assert not is_small(nn.Sequential(nn.Linear(2, 2), nn.Linear(1024, 1024)))


@pytest.mark.parametrize("group", [None, 1, 4])
@pytest.mark.parametrize("dtype", PACKED_TYPES)
def test_every_layer_of_a_module_gets_the_type_and_the_group_asked_for(dtype: torch.dtype, group: int | None) -> None:
    module = nn.Sequential(nn.Linear(1024, 1024), nn.Sequential(nn.Linear(1024, 1030)))
    pack_linears(module, dtype, group=group)
    packed = [part for part in module.modules() if isinstance(part, PackedLinear)]
    assert [part.dtype for part in packed] == [dtype, dtype]
    groups = [part.group for part in module.modules() if isinstance(part, GroupedLinear)]
    assert groups == ([] if group is None else [group, group])


@pytest.mark.parametrize("bias", [True, False])
def test_a_cast_layer_computes_in_fewer_bits_and_returns_what_it_was_given(bias: bool) -> None:
    linear, x = nn.Linear(512, 256, bias=bias), torch.randn(3, 5, 512)
    module = nn.Sequential(nn.Sequential(linear), nn.GELU())
    expected = module(x).detach()
    cast_linears(module, torch.bfloat16)
    (cast,) = (part for part in module.modules() if isinstance(part, CastLinear))
    assert cast.weight.dtype == torch.bfloat16
    assert (cast.bias is None) is not bias
    found = module(x)
    assert found.dtype == torch.float32
    assert not torch.equal(found, expected), "rounded"
    torch.testing.assert_close(found, expected, atol=0.03, rtol=0)


def test_a_gelu_goes_into_the_pass_of_the_layer_before_it() -> None:
    linear, x = nn.Linear(64, 96), torch.randn(40, 64)
    packed, after = packed_gelu(linear, nn.GELU(), torch.float32)
    assert isinstance(packed, PackedLinear)
    torch.testing.assert_close(after(packed(x)), nn.functional.gelu(linear(x)).detach(), atol=1e-5, rtol=0)
    other = nn.Identity()
    assert packed_gelu(other, after, torch.float32) == (other, after), "what is no linear layer stays"


def test_layers_on_another_device_stay_as_they_are() -> None:
    module = nn.Sequential(nn.Linear(4, 6).to("meta"))
    pack_linears(module)
    assert type(module[0]) is nn.Linear
    assert packed_gelu(module[0], nn.GELU(), torch.float32)[0] is module[0]
