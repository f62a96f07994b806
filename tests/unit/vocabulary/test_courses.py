"""Courses of ways, as prompts tell them."""

from __future__ import annotations

import pytest

from marey.vocabulary.courses import (
    ASIDE,
    CIRCLE,
    EIGHT,
    SIZES,
    STRAIGHT,
    ZIGZAG,
    dribbles_ahead,
    stated_course,
    without_course,
)


@pytest.mark.parametrize(
    ("prompt", "action", "kind", "side"),
    [
        ("a man walks to work", "walk", STRAIGHT, ""),
        ("she walks with her left arm up", "walk", STRAIGHT, ""),
        ("a courier runs at a steady pace", "run", STRAIGHT, ""),
        ("she runs along a forest trail", "run", STRAIGHT, ""),
        ("he strides with his shoulders back", "walk", STRAIGHT, ""),
        ("walks with a straight back, swinging both arms", "walk", STRAIGHT, ""),
        ("walks, one foot in front of the other", "walk", STRAIGHT, ""),
        ("a drunk staggers home across the alley", "walk", STRAIGHT, ""),
        ("a boxer stumbles about", "walk", STRAIGHT, ""),
        ("goblin limps away favouring the left", "walk", STRAIGHT, ""),
        ("limps off to the left, favouring the right leg", "walk", ASIDE, "left"),
        ("limps left", "walk", ASIDE, "left"),
        ("she jogs off to the right", "run", ASIDE, "right"),
        ("a knight walks away slowly to his left", "turn", ASIDE, "left"),
        ("the girl runs left", "run", ASIDE, "left"),
        ("an actor exits stage left", "walk", ASIDE, "left"),
        ("he walks in a big circle clockwise", "walk", CIRCLE, "right"),
        ("a dog walker circles the fountain", "turn", CIRCLE, ""),
        ("a spy runs in a zig-zag pattern", "run", ZIGZAG, ""),
        ("the deer girl runs a serpentine course", "run", ZIGZAG, ""),
        ("a waiter walks, weaving around the chairs", "walk", ZIGZAG, ""),
        ("an ice skater walks in a figure of eight", "walk", EIGHT, ""),
        ("jogs figure eights around two trees", "run", EIGHT, ""),
        ("a lion tamer walks in the shape of an infinity symbol", "walk", EIGHT, ""),
    ],
)
def test_ways_have_courses(prompt: str, action: str, kind: str, side: str) -> None:
    course = stated_course(prompt, action)
    assert course is not None
    assert (course.kind, course.side) == (kind, side)


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("a man walks and turns left", "walk"),
        ("he walks in a half circle", "walk"),
        ("he runs around in circles", "run"),
        ("she turns in a circle", "turn"),
        ("the skater whirls in a full circle on one foot", "walk"),
        ("he walks in a circle on the spot", "walk"),
        ("walks left and right", "walk"),
        ("walks to the right side of the room", "walk"),
        ("moves left", "sidestep"),
        ("turns left", "turn"),
        ("wanders around", "walk"),
        ("he paces back and forth", "walk"),
        ("she walks back", "walk"),
        ("runs along a winding path", "run"),
    ],
)
def test_other_ways_come_as_they_do(prompt: str, action: str) -> None:
    assert stated_course(prompt, action) is None


def test_wide_circles_are_larger() -> None:
    circles = [stated_course(f"walks in a {size}circle", "walk") for size in ("tight ", "", "wide ")]
    tight, usual, wide = (each.across for each in circles if each is not None)
    assert tight[1] < usual[0] < usual[1] < 3 <= wide[0]


@pytest.mark.parametrize(
    ("prompt", "across"),
    [
        ("a priest walks a circle of 1.5 m radius", 3.0),
        ("walks in a circle with a diameter of three metres", 3.0),
        ("runs in a circle five yards across", 4.57),
        ("walks one lap in a 2-metre circle", 2.0),
        ("walks in a circle, radius about 1 m", 2.0),
    ],
)
def test_circles_have_the_size_that_is_named(prompt: str, across: float) -> None:
    course = stated_course(prompt, "walk")
    assert course is not None
    assert sum(course.across) / 2 == pytest.approx(across, abs=0.02)


@pytest.mark.parametrize("prompt", ["walks in a circle at 2 m/s", "walks in a circle for 3 minutes"])
def test_other_numbers_are_no_size_of_a_circle(prompt: str) -> None:
    course = stated_course(prompt, "walk")
    assert course is not None
    assert course.across == SIZES[""]


@pytest.mark.parametrize(
    ("prompt", "action", "left"),
    [
        ("he jogs in a zigzag", "run", "he jogs"),
        ("she jogs off to the right", "run", "she jogs"),
        ("Walks in a large circle clockwise", "walk", "Walks"),
        ("she walks in a figure eight", "walk", "she walks"),
        ("zigzags through the trees", "run", ""),
        ("a man walks to work", "walk", "a man walks to work"),
    ],
)
def test_words_of_courses_are_left_out(prompt: str, action: str, left: str) -> None:
    assert without_course(prompt, action) == left


@pytest.mark.parametrize("prompt", ["dribbles a ball while walking forward", "he dribbles down the court"])
def test_straight_dribbles_are_told_from_others(prompt: str) -> None:
    assert dribbles_ahead(prompt)
    assert not dribbles_ahead(prompt + " past a defender")
    assert not dribbles_ahead("dribbles a basketball")
