"""The decoding loop: the published schedule and tokens, kept tokens, and passes that are left out."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import pytest
import torch
from torch import Tensor

from marey.models.momaskpp.config import RELEASED_HUMANML3D, TINY, InferenceConfig, MoMaskPPConfig
from marey.models.momaskpp.decoding import ScaleItems, decode, remaining_counts
from marey.models.momaskpp.model import ScaleTransformer
from marey.models.momaskpp.released import MASKED, renamed
from marey.models.momaskpp.scales import Scales
from marey.nn.convolution import frame_mask
from tests.models.momaskpp.published import drawn, masked_shapes, normal
from tests.models.momaskpp.test_released import GOLDEN, filled

SCHEDULES = {
    (120, 16): "120 119 117 114 110 104 97 89 80 71 60 49 37 25 13 1",
    (91, 18): "91 91 89 88 85 81 77 73 67 61 55 48 41 33 25 17 8 1",
    (75, 16): "75 75 73 71 69 65 61 56 50 44 38 31 23 16 8 1",
}


@pytest.mark.parametrize(("total", "steps"), SCHEDULES)
def test_the_schedule_is_the_published_one(total: int, steps: int) -> None:
    *before, last = remaining_counts(total, steps)
    assert before == [int(n) for n in SCHEDULES[total, steps].split()]
    assert last == 0


@pytest.mark.parametrize("steps", [1, 2, 7, 100])
@pytest.mark.parametrize("total", [0, 1, 2, 91])
def test_a_schedule_never_rises_and_ends_without_masks(total: int, steps: int) -> None:
    counts = remaining_counts(total, steps)
    assert len(counts) == steps + 1
    assert counts == sorted(counts, reverse=True)
    assert (counts[0], counts[-1]) == (total, 0)


@pytest.mark.parametrize(
    ("name", "cross", "lengths", "words"),
    [
        ("gen30_hml_ic", False, [49, 25], [20, 9]),
        pytest.param("gen30_hml_ca_short", True, [49, 7], [20, 3], marks=pytest.mark.slow),
    ],
)
@torch.no_grad()
def test_whole_loops_give_the_published_tokens(name: str, cross: bool, lengths: list[int], words: list[int]) -> None:
    golden, config = GOLDEN[name], RELEASED_HUMANML3D
    config = replace(config, masked=replace(config.masked, conditioning="cross-attention" if cross else "in-context"))
    scales = Scales.of(config)
    state = drawn(masked_shapes(512, scales.size, 4, cross=cross))
    state["token_emb.weight"] *= 30
    model = ScaleTransformer(config)
    filled(model, renamed(state, MASKED))
    states, present = normal(13, 2, 20, 768) * 0.2, frame_mask(torch.tensor(words), 20)
    items = make_items(model, scales, torch.tensor(lengths), states, present)
    made = decode(model, items, scales, replace(config.inference, temperature=0.0), lambda: None).tokens
    same = total = 0
    for block, expected, missing in zip(scales.split(made), golden["ids"], golden["neg"], strict=True):
        assert int((block < 0).sum()) == missing
        same += int((block == torch.tensor(expected)).sum())
        total += block.numel()
    assert same >= 0.98 * total  # near-equal confidences may swap


def make_items(model: ScaleTransformer, scales: Scales, lengths: Tensor, states: Tensor, present: Tensor) -> ScaleItems:
    size = (len(lengths), scales.size)
    return ScaleItems(
        lengths=lengths,
        seeds=torch.arange(len(lengths)),
        words=model.words(states),
        null=model.words(states, torch.ones(len(lengths), dtype=torch.bool)),
        present=present,
        tokens=torch.full(size, -1),
        kept=torch.zeros(size, dtype=torch.bool),
    )


@pytest.fixture(params=["in-context", "cross-attention"])
def tiny(request: pytest.FixtureRequest) -> tuple[ScaleTransformer, MoMaskPPConfig]:
    config = replace(TINY, masked=replace(TINY.masked, conditioning=request.param))
    torch.manual_seed(0)
    model = ScaleTransformer(config).eval().requires_grad_(False)
    for layer in model.modules():
        if isinstance(layer, torch.nn.Linear):
            torch.nn.init.normal_(layer.weight, std=0.2)
    return model, config


def test_kept_tokens_stay_and_the_others_follow_them(tiny: tuple[ScaleTransformer, MoMaskPPConfig]) -> None:
    model, config = tiny
    scales, lengths = Scales.of(config), torch.tensor([30, 45])
    states, present = torch.randn(2, 12, 384), torch.ones(2, 12, dtype=torch.bool)
    items = make_items(model, scales, lengths, states, present)
    free = decode(model, items, scales, config.inference, lambda: None).tokens
    kept = scales.valid(lengths)
    kept[:, scales.size - 20 :] = False
    asked = torch.where(kept, (free + 5) % 32, -1)
    made = decode(model, replace(items, tokens=asked, kept=kept), scales, config.inference, lambda: None).tokens
    assert torch.equal(made[kept], asked[kept])
    valid = scales.valid(lengths)
    assert torch.equal(made >= 0, valid)
    assert not torch.equal(made[valid & ~kept], free[valid & ~kept])
    whole = replace(items, tokens=torch.where(valid, free, -1), kept=valid)
    assert torch.equal(decode(model, whole, scales, config.inference, lambda: None).tokens, free)


def test_guidance_temperature_and_the_share_of_codes_change_the_draw(
    tiny: tuple[ScaleTransformer, MoMaskPPConfig],
) -> None:
    model, config = tiny
    scales = Scales.of(config)
    items = make_items(model, scales, torch.tensor([49]), torch.randn(1, 12, 384), torch.ones(1, 12, dtype=torch.bool))
    base = config.inference

    def made(inference: InferenceConfig) -> list[int]:
        return decode(model, items, scales, inference, lambda: None).tokens[0].tolist()

    found = [made(base), made(replace(base, guidance=1.0)), made(replace(base, temperature=0.0))]
    found += [made(replace(base, top_k=1.0)), made(replace(base, steps=12))]
    assert len({tuple(tokens) for tokens in found}) == 5
    assert made(replace(base, temperature=0.0)) == made(replace(base, top_k=1 / 32))


def test_items_that_are_dropped_leave_the_others_as_they_are(tiny: tuple[ScaleTransformer, MoMaskPPConfig]) -> None:
    model, config = tiny
    scales = Scales.of(config)
    items = make_items(
        model, scales, torch.tensor([44, 45, 46]), torch.randn(3, 12, 384), torch.ones(3, 12, dtype=torch.bool)
    )
    whole = decode(model, items, scales, config.inference, lambda: None).tokens
    answers = iter([None, torch.tensor([True, False, True]), *[None] * 10])
    some = decode(model, items, scales, config.inference, lambda: next(answers)).tokens
    assert torch.equal(some, whole[[0, 2]])


@pytest.mark.parametrize("steps", [2, 3, 18])
@pytest.mark.parametrize("total", [2, 48, 91])
def test_the_first_pass_has_all_tokens_to_decide_and_the_last_one(total: int, steps: int) -> None:
    counts = remaining_counts(total, steps)
    assert (counts[0], counts[-2:]) == (total, [1, 0])


def test_a_pass_that_keeps_no_token_is_left_out(
    tiny: tuple[ScaleTransformer, MoMaskPPConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, config = tiny
    scales, rows = Scales.of(config), list[int]()
    plain = ScaleTransformer.forward

    def forward(self: ScaleTransformer, tokens: Tensor, *rest: Any) -> Tensor:
        rows.append(len(tokens) // 2)  # with and without the words
        return plain(self, tokens, *rest)

    monkeypatch.setattr(ScaleTransformer, "forward", forward)
    states, present = torch.randn(2, 12, 384), torch.ones(2, 12, dtype=torch.bool)
    items = make_items(model, scales, torch.tensor([4, 45]), states, present)
    made = decode(model, items, scales, replace(config.inference, steps=20), lambda: None).tokens
    assert torch.equal(made >= 0, scales.valid(items.lengths))
    passes = [remaining_counts(scales.total(n), 20) for n in (4, 45)]
    wanted = [sum(a > b for a, b in pairwise(counts)) for counts in passes]
    assert sum(rows) == sum(wanted) < 2 * 20
    assert len(rows) == max(wanted)
