"""Words of gaits in place."""

from __future__ import annotations

import pytest

from marey.text.in_place_words import with_plain_gait_in_place


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a pony girl trots on the spot", "a pony girl jogs on the spot"),
        ("trotting in place, bored", "jogging in place, bored"),
        ("he strides on the spot", "he marches on the spot"),
        ("she paces on the spot", "she marches on the spot"),
        ("treading in one place", "walking in one place"),
        ("high knees in place", "runs in place with high knees"),
        ("a gym teacher does high knees on the spot", "a gym teacher runs on the spot with high knees"),
        ("he trots along the beach", "he trots along the beach"),
        ("she paces the room", "she paces the room"),
        ("runs with high knees", "runs with high knees"),
    ],
)
def test_gaits_in_place_have_plain_verbs(prompt: str, read: str) -> None:
    assert with_plain_gait_in_place(prompt) == read
