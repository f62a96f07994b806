"""Shots of a bow that are told in parts."""

from __future__ import annotations

import pytest

from marey.text.one_shot import with_whole_shots
from marey.text.sequence_reader import ReadMovement


def movements(*rows: tuple[str, str | None]) -> tuple[ReadMovement, ...]:
    return tuple(ReadMovement(text, action) for text, action in rows)


@pytest.mark.parametrize("action", ["aim", "shoot", "draw-bow", None])
def test_what_is_done_with_the_drawn_bow_is_one_movement_with_its_draw(action: str | None) -> None:
    told = movements(("kneels", "kneel"), ("draws her bow", "draw-bow"), ("then takes aim and releases", action))
    assert with_whole_shots(told) == movements(
        ("kneels", "kneel"), ("draws her bow, then takes aim and releases", "draw-bow")
    )


@pytest.mark.parametrize(
    ("text", "action"),
    [("aims his pistol", "aim"), ("runs away", "run"), ("draws another arrow", "draw-bow"), ("waves", "wave")],
)
def test_another_weapon_another_shot_and_other_movements_stay_apart(text: str, action: str) -> None:
    told = movements(("draws a bow", "draw-bow"), (text, action))
    assert with_whole_shots(told) == told


def test_a_rifle_is_aimed_and_fired_in_two_movements() -> None:
    told = movements(("aims", "aim"), ("fires", "shoot"))
    assert with_whole_shots(told) == told
