"""Words in the order in which the vocabulary has them."""

from __future__ import annotations

import pytest

from marey.text.word_order import in_usual_order


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("hops forward four times on his left leg", "hops forward on his left leg four times"),
        ("jumping twice on one foot", "jumping on one foot twice"),
        ("hops four times, then stands on one leg", "hops four times, then stands on one leg"),
        ("jumps forward three times", "jumps forward three times"),
        ("kicks three times on the left side", "kicks three times on the left side"),
    ],
)
def test_the_foot_comes_before_the_number(prompt: str, read: str) -> None:
    assert in_usual_order(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("hop left 4, hop right 2", "hop left 4 times, hop right 2 times"),
        ("kicks to the left 3 and bows", "kicks to the left 3 times and bows"),
        ("steps left 3 meters", "steps left 3 meters"),
        ("turns left 90 degrees", "turns left 90 degrees"),
        ("she walks back a few steps", "she takes a few steps back"),
        ("moving forward several small steps", "taking several small steps forward"),
        ("he is stepping back a few steps", "he is taking a few steps back"),
        ("walks back to the steps", "walks back to the steps"),
    ],
)
def test_numbers_and_steps_are_said_as_the_vocabulary_has_them(prompt: str, read: str) -> None:
    assert in_usual_order(prompt) == read
