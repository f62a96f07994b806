"""Captions of changed clips stay true: mirrored, made to travel, repeated."""

from __future__ import annotations

import pytest

from marey.data import wording


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Left foot first, he turns right.", "Right foot first, he turns left."),
        ("an upright body, right-handed, moves leftward", "an upright body, left-handed, moves rightward"),
        ("turning clockwise to the right", "turning counterclockwise to the left"),
        ("spins counter-clockwise", "spins clockwise"),
        ("drops right down", "drops right down"),
        ("cuts from the right down", "cuts from the left down"),
        ("back on the spot it had left", "back on the spot it had left"),
        ("throws a left and two rights", "throws a right and two lefts"),
    ],
)
def test_a_mirror_image_exchanges_sides_and_no_other_words(text: str, said: str) -> None:
    assert wording.mirrored(text) == said


@pytest.mark.parametrize("text", ["upright, right-footed, to the left", "clockwise, then anticlockwise right away"])
def test_the_mirror_image_of_a_mirror_image_says_the_same(text: str) -> None:
    assert wording.mirrored(wording.mirrored(text)).replace("counter", "anti") == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("walk in place, arms swinging", "walk, arms swinging"),
        ("A man walks on the spot.", "A man walks."),
        ("walk fast", "walk fast"),
        ("Walks, but the figure keeps its place.", None),
        ("keep stepping without going anywhere", None),
        ("in place", None),
    ],
)
def test_a_gait_that_travels_is_no_longer_said_to_stay(text: str, said: str | None) -> None:
    assert wording.travelling(text) == said


def test_a_repeated_cycle_is_no_longer_said_to_be_one() -> None:
    assert wording.repeated("walks for one cycle, arms swing") == "walks, arms swing"
    assert wording.repeated("One cycle of a walk.") is None
    assert wording.repeated("does one stroke") is None
