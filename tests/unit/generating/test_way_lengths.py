"""Lengths of ways in sequences."""

from __future__ import annotations

from dataclasses import replace

import pytest

from marey.generation.port import Limits
from marey.generation.shots.way_lengths import GOES_ON_S, LEAST_S, with_least_ways
from tests.unit.generating.test_timelines import text_of

FPS = 20.0
LIMITS = Limits(16, 196, FPS, 4)


def least(said: str, plain: str, then: str, *, stated: int | None = None) -> int:
    """Return the frames of the first of two movements, of 20 frames each as the model gives them."""
    first, second = (
        replace(text_of(words, 4), prompt=words, rewritten=read) for words, read in ((said, plain), (then, then))
    )
    return with_least_ways([first, second], [20, 20], LIMITS, [stated, None])[0]


def test_a_way_is_seen_before_what_comes_next_and_longer_before_what_goes_out_of_its_speed() -> None:
    assert least("she strolls along", "a person walks forward", "a person waves") == round(LEAST_S * FPS)
    assert least("she strolls along", "a person walks forward", "a person dies") == round((LEAST_S + GOES_ON_S) * FPS)


@pytest.mark.parametrize("said", ["takes two steps forward", "walks 1 metre", "walks a bit", "walks a short way"])
def test_ways_whose_words_say_how_far_they_go_stay(said: str) -> None:
    assert least(said, "a person walks forward", "a person waves") == 20


def test_stated_lengths_and_other_movements_stay() -> None:
    assert least("she strolls along", "a person walks forward", "a person waves", stated=20) == 20
    assert least("she bows", "a person bows", "a person waves") == 20
