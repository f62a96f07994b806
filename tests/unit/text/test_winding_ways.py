"""Ways that wind."""

from __future__ import annotations

import pytest

from marey.text.winding_ways import with_plain_zigzag


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a fox girl runs, weaving between the trees", "a fox girl runs in a zigzag pattern"),
        ("He jogs through the market weaving around people", "He jogs in a zigzag pattern"),
        ("slaloms past the poles", "walks in a zigzag pattern"),
        ("she is zigzagging quickly through the cones", "she is running in a zigzag pattern"),
        ("sprints in zigzags, to evade the drone", "sprints in a zigzag pattern"),
        ("zigzag jog as if dodging bullets", "zigzag jog"),
        ("walks a slalom around chairs", "walks in a zigzag pattern"),
        ("the waiter weaves his way through the crowd", "the waiter walks in a zigzag pattern"),
    ],
)
def test_words_of_winding_ways_are_plain(prompt: str, read: str) -> None:
    assert with_plain_zigzag(prompt) == read


@pytest.mark.parametrize(
    "prompt",
    [
        "weaves around punches",
        "a fighter ducks and weaves",
        "she weaves a rug",
        "he runs, dodging to the left",
        "runs in a zigzag line",
        "swerves left and right",
        "walks around the cones",
        "dodges the ball and runs",
    ],
)
def test_other_words_stay(prompt: str) -> None:
    assert with_plain_zigzag(prompt) == prompt
