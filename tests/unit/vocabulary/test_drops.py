"""Jumps down, landings in a crouch, and hands that draw a blade."""

from __future__ import annotations

import pytest

from marey.quality.limits import expected_by_prompts
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.drops import lands_low, stated_drop


@pytest.mark.parametrize(
    ("prompt", "drop"),
    [
        ("drops from the roof", ("high", False)),
        ("jumps off a crate and lands heavily", ("low", True)),
        ("jump down", ("", False)),
        ("jumps up and down", None),
        ("jumps from the left to the right", None),
        ("leaps from the roof to the next building", None),
        ("drops the box", None),
        ("jumps three times", None),
    ],
)
def test_a_jump_down_says_from_what(prompt: str, drop: tuple[str, bool] | None) -> None:
    assert stated_drop(prompt) == drop


def test_who_jumps_down_may_begin_over_the_floor() -> None:
    assert "raised" in expected_by_prompts(["jumps down from the wall"]).supports
    assert "raised" not in expected_by_prompts(["jumps over the wall"]).supports


def test_a_jump_ends_in_a_crouch_where_the_words_say_so() -> None:
    assert lands_low("jump left landing low")
    assert lands_low("leaps up and lands in a low crouch")
    assert not lands_low("jumps and lands softly")


@pytest.mark.parametrize(
    ("prompt", "hand"),
    [
        ("draws the sword from the left hip", "right"),
        ("unsheathes his katana from his right side", "left"),
        ("pulls a dagger from the left boot", "left"),
        ("draws the sword with his left hand", "left"),
        ("draws the rapier from the scabbard at his left hip with his right hand", "right"),
        ("draws his sword", ""),
    ],
)
def test_a_blade_is_drawn_across_the_body(prompt: str, hand: str) -> None:
    assert [(each.name, each.acts) for each in stated_bearings(prompt)] == [("sword-drawn", hand)]
