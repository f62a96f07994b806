"""The inference twin of a model on a processor and elsewhere; torch's device without memory stands for a card."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from marey.models.mogo.config import TINY, MOGOConfig
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.streaming import StreamBatch
from marey.nn.packed import CastLinear, GroupedLinear
from tests.support.processors import PACKED_TYPES

from .networks import FLAT, TOLD_BY_TOKEN, columns, prompts, transformer

ELSEWHERE = torch.device("meta")
JOINT = replace(TINY, transformer=replace(TINY.transformer, joint=True))
GUIDED = replace(TINY, inference=replace(TINY.inference, guidance=2.0, upper_guidance=3.0))


def layers(packed: PackedModel, kind: type[nn.Module]) -> dict[str, nn.Module]:
    return {name: layer for name, layer in packed.network.named_modules() if isinstance(layer, kind)}


@pytest.mark.parametrize("dtype", PACKED_TYPES)
def test_on_a_processor_every_matrix_is_grouped(dtype: torch.dtype) -> None:
    model = transformer(TINY)
    packed = PackedModel(model, dtype=dtype, group=3)
    assert packed.kept == torch.float32
    assert not layers(packed, nn.Linear)
    grouped = layers(packed, GroupedLinear)
    assert grouped.keys() == {name for name, layer in model.named_modules() if isinstance(layer, nn.Linear)}
    assert {layer.group for layer in grouped.values()} == {3}


@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_elsewhere_matrices_have_the_type_asked_for_and_so_have_keys_and_values(dtype: torch.dtype) -> None:
    model = transformer(TINY).to(ELSEWHERE)
    packed = PackedModel(model, dtype=dtype)
    cast = layers(packed, CastLinear)
    assert {layer.weight.dtype for layer in cast.values()} == {dtype}
    assert layers(packed, nn.Linear).keys() == {"head"}, "codes tie in bfloat16"
    assert StreamBatch(packed, 2).state.memory.dtype == packed.kept == dtype
    rounded = replace(TINY, float_logits=False)
    assert not layers(PackedModel(transformer(rounded).to(ELSEWHERE), dtype=dtype), nn.Linear)


@pytest.mark.parametrize("config", [TINY, FLAT, JOINT, TOLD_BY_TOKEN, GUIDED])
def test_a_step_makes_no_tensor_on_another_device_and_reads_no_value_from_it(config: MOGOConfig) -> None:
    """Products of tensors of two devices are refused; the device holds no values that could be read."""
    streams = StreamBatch(PackedModel(transformer(config).to(ELSEWHERE)), 3)
    sentence = prompts(1)[0, 0].to(ELSEWHERE)
    begun = streams.start(sentence, 1)
    streams.start(sentence, 2, ends_from=0)
    streams.start(sentence, 3, past=columns(30)[0].to(ELSEWHERE))
    drawn: list[Tensor] = [*streams.step().values()]
    streams.steer(begun, sentence)
    drawn += streams.step().values()
    assert {each.device for each in drawn} == {ELSEWHERE}
    assert {each.device for each in vars(streams.state).values()} == {ELSEWHERE}
