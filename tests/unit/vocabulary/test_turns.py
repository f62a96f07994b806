"""How far a prompt asks a body to turn."""

from __future__ import annotations

import pytest

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.turns import STRAIGHT, Turn, stated_spins, stated_turn, turns_in_place


@pytest.mark.parametrize(
    ("prompt", "action", "degrees"),
    [
        ("turns left 90 degrees", "turn-around", 90),
        ("pivot 45° to the right", "turn-around", 45),
        ("a ninety-degree turn", "turn", None),
        ("he turns ninety degrees", "turn-around", 90),
        ("a quarter turn to the left", "turn-around", 90),
        ("about-face", "turn-around", 180),
        ("jump up and land facing the other way", "jump-turn", 180),
        ("180 jump, two feet", "jump-turn", 180),
        ("make a U-turn", "turn", 180),
        ("walks in a circle", "walk", 360),
        ("circles the table", "turn", 360),
        ("walks a half circle", "turn", 180),
        ("a semicircle", "turn", 180),
        ("turn 90 then 180 degrees", "turn-around", None),
        ("jump with a 180", "jump", 180),
    ],
)
def test_stated_degrees(prompt: str, action: str, degrees: float | None) -> None:
    turn = stated_turn(prompt, action)
    assert (turn.most if turn is not None and turn.is_exact else None) == degrees


@pytest.mark.parametrize(
    ("prompt", "action", "bounds"),
    [
        ("veer slightly right", "turn", (45, 60)),
        ("make a sharp left", "turn", (80, 110)),
        ("she turns around to see who is behind her", "turn-around", (175, 185)),
        ("turns to the left", "turn-around", (85, 95)),
        ("pivots", "turn-around", (80, 190)),
        ("changes direction", "turn", (60, 120)),
        ("a man runs for the bus", "run", (0, STRAIGHT)),
        ("jump", "jump", (0, STRAIGHT)),
    ],
)
def test_extents_without_degrees(prompt: str, action: str, bounds: tuple[float, float]) -> None:
    turn = stated_turn(prompt, action)
    assert turn is not None
    assert (turn.least, turn.most) == bounds


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("he wanders about", "walk"),
        ("run to the left", "run"),
        ("bows 90 degrees", "bow"),
        ("zigzag run", "run"),
        ("jump around", "jump-turn"),
    ],
)
def test_what_turns_as_it_comes(prompt: str, action: str) -> None:
    assert stated_turn(prompt, action) is None


def test_circles_turn_all_along() -> None:
    circle, corner = stated_turn("walk in a circle", "walk"), stated_turn("turn 90 degrees", "turn")
    assert circle is not None
    assert circle.even
    assert corner is not None
    assert not corner.even


def test_a_turn_of_a_motion() -> None:
    bounds, whole = Turn(60, 120), Turn(whole=True)
    assert [bounds.of(made) for made in (-10, 80, -300)] == [60, 80, 120]
    assert [whole.of(made) for made in (-400, 600, 100)] == [360, 720, 100]


def test_spins_by_their_angle() -> None:
    assert [stated_spins(text) for text in ("spin 720 degrees", "do a 360", "spins 90 degrees", "spin")] == [
        2,
        1,
        None,
        None,
    ]


def test_actions_of_the_table_are_in_the_vocabulary() -> None:
    from marey.vocabulary.turns import _table

    table = _table()
    assert {*table.ways, *table.usual} <= set(load_vocabulary().actions)


@pytest.mark.parametrize(
    ("prompt", "in_place"),
    [
        ("turns left", True),
        ("a woman turns to face the other way", True),
        ("makes a complete turn", True),
        ("someone takes a right turn", True),
        ("steps around on the spot until she faces us", True),
        ("walks and turns left", False),
        ("he is jogging and veers off", False),
        ("turns the corner", False),
        ("goes along, then turns right", False),
        ("keeps moving and turns", False),
    ],
)
def test_turns_whose_words_speak_of_no_way(prompt: str, in_place: bool) -> None:
    assert turns_in_place(prompt) is in_place
