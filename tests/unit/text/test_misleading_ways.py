"""Words of ways of which models read another action."""

from __future__ import annotations

import pytest

from marey.text.misleading_ways import with_exits
from marey.text.misleading_words import without_misleading


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("exits stage left", "walks off to the left"),
        ("the singer heads left", "the singer walks off to the left"),
        ("bows and leaves", "bows and walks away"),
        ("she waves, then leaves quickly", "she waves, then walks away quickly"),
        ("leaving, he waves", "walking away, he waves"),
        ("a woman turns her head to the left", "a woman turns her head to the left"),
        ("the robot moves its head right", "the robot moves its head right"),
        ("he leaves a box on the table", "he leaves a box on the table"),
        ("rakes the leaves", "rakes the leaves"),
        ("throws leaves and laughs", "throws leaves and laughs"),
    ],
)
def test_who_exits_walks_off_and_a_head_that_turns_does_not(prompt: str, read: str) -> None:
    assert with_exits(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a kung fu master does a high kick", "a person does a high kick"),
        ("a judo fighter throws a punch", "a person throws a punch"),
        ("a karate teacher practices a kata", "a karate teacher practices a kata"),
        ("the coach points to the bench", "the coach points at the bench"),
        ("points to the left", "points to the left"),
    ],
)
def test_who_does_it_is_no_movement_and_things_are_pointed_at(prompt: str, read: str) -> None:
    assert without_misleading(prompt) == read
