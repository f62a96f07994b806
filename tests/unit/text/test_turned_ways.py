"""Turns in words of which models read another action."""

from __future__ import annotations

import pytest

from marey.text.misleading_words import without_misleading
from marey.text.turned_ways import with_turns_told


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("takes a sharp left", "takes a sharp left turn"),
        ("a man hangs a left at the corner", "a man takes a left turn at the corner"),
        ("wheels about to confront him", "turns around quickly to confront him"),
        ("wheeling around", "turning around quickly"),
        ("she whirls around and faces the door", "she turns around quickly and faces the door"),
        ("spinning around to look behind", "turning around quickly to look behind"),
        ("the soldier executes a right face", "the soldier turns right 90 degrees in place"),
        ("jogs and turns sharply to the left", "jogs and takes a left turn sharply"),
        ("run and bear right", "run and take a right turn"),
        ("the sentry about-faces and marches off", "the sentry turns around and marches off"),
        ("turns about-face, then salutes", "turns around, then salutes"),
        ("turns left and takes two more steps", "turns left, then takes two more steps"),
        ("turns to the right, and walks 3 meters", "turns to the right, then walks 3 meters"),
    ],
)
def test_turns_are_told_as_such(prompt: str, told: str) -> None:
    assert with_turns_told(prompt) == told
    assert without_misleading(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "takes a left hook",
        "takes a hard right to the jaw",
        "hangs from a left hand",
        "cartwheels around",
        "wheels around the barrow",
        "whirls around twice",
        "spins around to the music",
        "makes a right fist",
        "runs and turns left, then right",
        "runs and turns around",
        "does an about-face and salutes",
    ],
)
def test_what_is_no_such_turn_stays(prompt: str) -> None:
    assert with_turns_told(prompt) == prompt
