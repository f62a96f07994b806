"""Lengths of ways in sequences."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.port import Limits
from marey.generation.shots.strands import RowStrand
from marey.generation.shots.way_lengths import GOES_ON_S, LEAST_S, with_least_ways
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
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


@pytest.mark.parametrize(("said", "action"), [("turns around", "turn-around"), ("turns left", "turn")])
def test_every_turn_on_the_spot_counts_for_the_way_back(said: str, action: str) -> None:
    plain = {"turn-around": "a person turns in place", "turn": "a person turns left"}[action]
    turned = stated_features(HUMANML3D_263, "turn-around", FineWish(prompt="turns around"), None, 3)
    text = replace(text_of(said, 4), prompt=said, rewritten=plain)
    row: Any = SimpleNamespace(text=text, is_drawn=True, features=turned)
    assert abs(RowStrand.as_way(row, HUMANML3D_263).turn) > 150.0
