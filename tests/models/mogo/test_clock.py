"""How long ago an action began, in training and while it streams."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from marey.models.mogo.clock import UNKNOWN_TIME, Clock
from marey.models.mogo.config import TINY
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.plan import STOPS
from marey.models.mogo.streaming import StreamBatch
from marey.streams.actions import ActionStart

from .networks import columns, prompts, transformer


def clock(hidden_share: float = 0.0) -> Clock:
    """One that tells frames apart."""
    torch.manual_seed(0)
    return Clock(8, 20, hidden_share)


def test_nothing_is_added_where_nobody_knows_and_all_that_is_far_is_alike() -> None:
    told = clock()(torch.tensor([UNKNOWN_TIME, 0, 3, 20, 500, 19]))
    assert not told[0].any()
    assert told[1].any()
    assert not torch.equal(told[1], told[2])
    assert torch.equal(told[3], told[4])
    assert not torch.equal(told[3], told[5])  # the last one that counts is 20


def test_time_begins_anew_at_a_seam_and_counts_what_was_cut_off() -> None:
    made = clock()
    found = made.of_actions(2, 5, torch.tensor([0, 4]), torch.tensor([3, 6]))
    # products of other sizes may round differently
    torch.testing.assert_close(found[0], made(torch.tensor([1, 2, 0, 1, 2])))
    torch.testing.assert_close(found[1], made(torch.tensor([5, 6, 7, 8, 9])))
    torch.testing.assert_close(made.of_actions(1, 3, None, None)[0], made(torch.tensor([1, 2, 3])))


def test_training_keeps_the_time_of_some_acts_to_itself_each_whole() -> None:
    made = clock(hidden_share=0.5).train()
    found = made.of_actions(400, 6, None, torch.full((400,), 4)).any(-1)  # (400, 6): whether anything was told
    first, second = found[:, 0], found[:, 4]
    assert torch.equal(found, torch.stack([first] * 3 + [second] * 3, 1))
    for action in (first, second):
        assert 0.35 < float(action.float().mean()) < 0.65
    assert 0.35 < float((first == second).float().mean()) < 0.65  # each action by itself
    assert made.eval().of_actions(400, 6, None, None).any(-1).all()


@pytest.mark.parametrize(("frame", "told"), [(6, True), (7, False)])
def test_the_clock_of_an_act_that_goes_on_although_it_is_over_stops(frame: int, told: bool) -> None:
    usual = 4
    assert int(STOPS * usual) == 6
    packed = PackedModel(transformer())
    assert packed.times is not None

    def state() -> torch.Tensor:
        streams = StreamBatch(packed, 1)
        streams.start(prompts(1)[0], 1, past=columns(10)[0], began=ActionStart(0, 0), lasts=[usual])
        return streams.states()

    before = state()
    packed.times[frame] += 1
    assert torch.equal(state(), before) != told


@pytest.mark.parametrize(("frame", "told"), [(1, True), (10, True), (11, False)])
def test_frames_that_were_read_again_have_the_time_that_they_were_drawn_with(frame: int, told: bool) -> None:
    packed = PackedModel(transformer())
    assert packed.times is not None

    def state() -> torch.Tensor:
        streams = StreamBatch(packed, 1)
        streams.start(prompts(1)[0], 1, past=columns(10)[0], began=ActionStart(0, 0))
        return streams.states()

    before = state()
    packed.times[frame] += 1
    assert torch.equal(state(), before) != told


def test_guidance_is_told_no_time_where_it_is_told_no_prompt() -> None:
    packed = PackedModel(transformer())
    assert packed.times is not None

    def branches() -> tuple[torch.Tensor, torch.Tensor]:
        streams = StreamBatch(packed, 1, replace(TINY.inference, guidance=2.0))
        streams.start(prompts(1)[0], 1, past=columns(10)[0], began=ActionStart(0, 0))
        conditional, unconditional = streams.states().chunk(2, 1)
        return conditional, unconditional

    before = branches()
    packed.times += 1
    after = branches()
    assert not torch.equal(before[0], after[0])
    assert torch.equal(before[1], after[1])
