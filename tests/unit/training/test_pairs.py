"""Which clips are drawn, and which part of them is learned."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
import torch

from marey.data.manifest import Clip, Measured
from marey.training.motions import Cuts, TokenData
from marey.training.pairs import Pairs

if TYPE_CHECKING:
    from marey.training.sentences import SentenceData

CPU = torch.device("cpu")
LENGTHS = (30, 30, 30, 6)
CONTENTS = ("walk", "bow", "walk", "walk")
"""A walk, a bow, a sequence that begins with a walk, and a walk that is hardly longer than the shortest part."""
LEAST = 4


def clip(content: str, acts: int) -> Clip:
    return Clip(
        id=content,
        start=0,
        length=120,
        joints_start=0,
        split="train",
        dataset="studio",
        content=content,
        style="",
        mirrored=False,
        spliced=(),
        acts=("cmu",) * acts,
        measured=Measured(seconds=1, path=0, turn=0, speed=0, steps=0, side=""),
        captions=("a person moves",),
    )


@pytest.fixture
def tokens() -> TokenData:
    """Token i of all clips, one after another, is i: a part tells where it was cut."""
    starts = torch.tensor(LENGTHS).cumsum(0) - torch.tensor(LENGTHS)
    return TokenData(torch.arange(sum(LENGTHS))[:, None], starts[:, None], torch.tensor(LENGTHS)[:, None])


def pairs(tokens: TokenData, crops: float) -> Pairs:
    clips = [clip(content, 1 + (number == 2)) for number, content in enumerate(CONTENTS)]
    captions = cast("SentenceData", SimpleNamespace(count=np.ones(len(clips), int)))
    return Pairs(clips, tokens, captions, LEAST, crops=crops)


def parts_of(number: int, tokens: TokenData, crops: float, draws: int = 400) -> list[list[int]]:
    """Tokens of many draws of one clip."""
    clips = np.full(draws, number)
    cuts = pairs(tokens, crops).cuts(clips, np.random.default_rng(0), CPU)
    found, lengths = tokens.batch(torch.from_numpy(clips), torch.zeros(draws, dtype=torch.long), 49, cuts=cuts)
    return [row[:length, 0].tolist() for row, length in zip(found, lengths.tolist(), strict=True)]


def test_parts_of_a_walk_lie_anywhere_in_it_and_have_any_length(tokens: TokenData) -> None:
    parts = parts_of(0, tokens, 1.0)
    assert all(part == list(range(part[0], part[0] + len(part))) for part in parts)
    assert {len(part) for part in parts} == set(range(LEAST, 31))
    assert min(part[0] for part in parts) == 0
    assert max(part[-1] for part in parts) == 29
    short = [part[0] for part in parts if len(part) <= 10]
    assert min(short) < 5 < 15 < max(short)


def test_only_a_share_of_the_draws_is_a_part(tokens: TokenData) -> None:
    whole = sum(len(part) == 30 for part in parts_of(0, tokens, 0.25))
    assert whole / 400 == pytest.approx(0.75, abs=0.08)


@pytest.mark.parametrize("number", [1, 2])
def test_actions_with_a_beginning_and_an_end_and_sequences_stay_whole(tokens: TokenData, number: int) -> None:
    assert {len(part) for part in parts_of(number, tokens, 1.0)} == {30}


def test_no_part_is_shorter_than_the_shortest_motion(tokens: TokenData) -> None:
    assert {len(part) for part in parts_of(3, tokens, 1.0)} == {4, 5, 6}


def test_without_crops_nothing_is_drawn(tokens: TokenData) -> None:
    """Trainings of earlier configurations draw what they drew."""
    rng = np.random.default_rng(0)
    assert pairs(tokens, 0.0).cuts(np.zeros(3, int), rng, CPU) is None
    assert rng.random() == np.random.default_rng(0).random()


def test_a_long_clip_is_cut_within_what_the_model_learns(tokens: TokenData) -> None:
    cuts = Cuts(torch.tensor([1.0]), torch.tensor([0.99]), LEAST)
    found, lengths = tokens.batch(torch.tensor([0]), torch.tensor([0]), 20, cuts=cuts)
    assert lengths.tolist() == [20]
    assert found[0, :, 0].tolist() == list(range(20))
