"""Verbs whose meaning other words of a prompt decide."""

from __future__ import annotations

import pytest

from marey.text.by_context import with_words_by_context


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("a basketball player dribbles, then shoots", "a basketball player dribbles, then shoots the basketball"),
        ("a striker runs up and shoots", "a striker runs forward and shoots at the goal"),
        ("an archer walks in, draws and fires", "an archer walks in, draws the bow and shoots an arrow"),
        ("an archer draws, aims and releases", "an archer draws the bow, aims and shoots an arrow"),
        ("walks up, looks around and sits", "walks forward, looks around and sits"),
        ("shields his eyes and looks into the distance", "shields his eyes and stands still"),
    ],
)
def test_they_say_what_they_mean(prompt: str, told: str) -> None:
    assert with_words_by_context(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "a soldier runs in and shoots",
        "a cop in a football shirt pulls a gun and shoots",
        "walks up the stairs",
        "walks up and reaches the top of the stairs",
        "an artist draws and paints",
        "walks while looking into the distance",
    ],
)
def test_other_words_stay(prompt: str) -> None:
    assert with_words_by_context(prompt) == prompt
