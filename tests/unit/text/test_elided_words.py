"""Words that prompts leave out, written back."""

from __future__ import annotations

import pytest

from marey.text.elided_words import parts_by_sides, with_elided


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("points left, then right", "points left, then points right"),
        ("kneels on the right knee and then stands", "kneels on the right knee and then stands up"),
        ("a monk sits, then slowly rises and bows", "a monk sits, then slowly rises up and bows"),
        ("sits, gets up and stands", "sits, gets up and stands"),
        ("sits and stands still", "sits and stands still"),
        (
            "a man takes four large steps forward then turns left and takes two more",
            "a man takes four large steps forward then turns left and takes two more steps",
        ),
        (
            "takes three steps to the left, then two more back",
            "takes three steps to the left, then takes two more steps back",
        ),
        ("throws two punches, ducks and throws another one", "throws two punches, ducks and throws another one punch"),
        ("lands three kicks, rests, then one more", "lands three kicks, rests, then lands one more kick"),
        ("waits four seconds, then takes two", "waits four seconds, then takes two"),
        (
            "points to the left, at the ceiling and at himself",
            "points to the left, then points at the ceiling, then points at himself",
        ),
        (
            "he waves with the left hand and then with the right",
            "he waves with the left hand, then waves with the right hand",
        ),
        (
            "a tired archer points to the left, then to the right",
            "a tired archer points to the left, then points to the right",
        ),
        (
            "three hops on the right foot, two on the left",
            "three hops on the right foot, then two hops on the left foot",
        ),
        (
            "hops twice on his left leg, then once on the right",
            "hops twice on his left leg, then hops once on his right leg",
        ),
        (
            "hops once on the left foot, then twice on the right foot, then bows",
            "hops once on the left foot, then hops twice on the right foot, then bows",
        ),
        (
            "waves with the left hand, then the right and sits",
            "waves with the left hand, then waves with the right hand and sits",
        ),
        ("lifts the left leg, then the right arm", "lifts the left leg, then lifts the right arm"),
        ("waves left and right", "waves left and right"),
        ("looks left, then right", "looks left, then right"),
        ("jabs left, then right", "jabs left, then right"),
        ("raises the left hand, then waves right", "raises the left hand, then waves right"),
    ],
)
def test_what_is_done_on_the_other_side_has_its_verb(prompt: str, read: str) -> None:
    assert with_elided(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("walk start", "stands still, then walks"),
        ("start jogging", "stands still, then jogs"),
        ("idle to run", "stands still, then runs"),
        ("run start to stop", "stands still, then runs, then stops"),
        ("sprint to idle", "sprints and stops"),
        ("a person starts walking", "a person starts walking"),
        ("walk to the stop", "walk to the stop"),
    ],
)
def test_names_of_takes_have_a_body_stand_before_or_after_a_way(prompt: str, read: str) -> None:
    assert with_elided(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "parts", "rests"),
    [
        (
            "kicks with the left leg, then kicks with the right leg",
            ("kicks with the left leg", "kicks with the right leg"),
            (),
        ),
        ("three hops on the left, then two hops on the right", ("three hops on the left", "two hops on the right"), ()),
        ("waves left, then waves right, then stands still", ("waves left", "waves right"), ("stands still",)),
        ("waves left, then waves right, then sits down", (), ()),
        ("dodges left, then dodges right", (), ()),
        ("points left, then walks right", (), ()),
        ("points left", (), ()),
    ],
)
def test_sides_in_turn_are_parts(prompt: str, parts: tuple[str, ...], rests: tuple[str, ...]) -> None:
    assert parts_by_sides(prompt) == (parts, rests)
