"""Legs that a prompt names: the one that stands and the one that is lifted."""

from __future__ import annotations

import pytest

from marey.vocabulary.legs import stated_leg


@pytest.mark.parametrize(
    ("prompt", "action", "leg"),
    [
        ("kicks with the right foot while standing on the left", "kick", "right"),
        ("standing on his left leg, he kicks with the right", "kick", "right"),
        ("with the left foot planted she kicks ahead", "kick", "right"),
        ("kicks to the right with the left foot", "kick", "left"),
        ("kicks the ball with the left foot, right arm back", "kick-ball", "left"),
        ("stands on one leg, the left knee raised", "balance", "right"),
        ("balances on the right foot, left knee up", "balance", "right"),
        ("lifts the right foot off the floor and holds it", "balance", "left"),
        ("with the weight on the left leg, the right foot swings back", "balance", "left"),
        ("balances on one leg with the left arm up", "balance", ""),
        ("balances a book on the right hand", "balance", ""),
        ("stands on the left leg, then on the right", "balance", ""),
        ("stands on the right leg, left leg lifted behind", "arabesque", "left"),
        ("hops on the right foot, left knee up", "hop", "right"),
        ("walks on the left foot", "walk", ""),
    ],
)
def test_words_say_which_leg_acts_and_which_one_stands(prompt: str, action: str, leg: str) -> None:
    assert stated_leg(prompt, action) == leg
