"""Phrases that the readers take for other movements are told in plain words."""

from __future__ import annotations

import pytest

from marey.text.plain_phrases import with_plain_phrases


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("she runs, trips on a root, regains her balance", "she runs, stumbles forward"),
        ("the boy stumbles, almost falls, but catches himself", "the boy stumbles forward"),
        ("she stumbles, nearly falling, and recovers", "she stumbles forward"),
        ("trips, finds his footing and keeps jogging", "stumbles forward, then keeps jogging"),
        ("she trips over a root and catches a ball", "she trips over a root and catches a ball"),
        ("she trips over a root and gets up", "she trips over a root and gets up"),
    ],
)
def test_who_trips_and_catches_himself_does_not_fall(prompt: str, said: str) -> None:
    assert with_plain_phrases(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("run in, wave, run back out", "run in, wave, turn around and run out"),
        (
            "she sits, gets up, then walks back over to the desk",
            "she sits, gets up, then turns around and walks over to the desk",
        ),
        ("wave, turn around, walk back out", "wave, turn around, walk out"),
        ("turns around and comes back", "turns around and walks forward"),
        ("walk back three steps", "walk back three steps"),
        ("paces back and forth", "paces back and forth"),
    ],
)
def test_ways_back_out_begin_with_a_turn(prompt: str, said: str) -> None:
    assert with_plain_phrases(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("does 5 squats, waves, then does 3 more", "does 5 squats, waves, then does 3 more squats"),
        ("walk two stairs, wave, walk two more", "walk two stairs, wave, walk two more stairs"),
        ("drinks two cups, then drinks two more", "drinks two cups, then drinks two more"),
        ("walk 2 m back, then 3 steps forward", "walk 2 m back, then walk 3 steps forward"),
        ("runs forward 5 m, then back 2 m", "runs forward 5 m, then runs back 2 m"),
        ("two steps right, two steps left", "two steps right, two steps left"),
        ("lift a crate, walk, set it down on the shelf", "lift a crate, walk, set the crate on the shelf"),
        ("lift a cup, set it on the table", "lift a cup, set it on the table"),
    ],
)
def test_what_a_clause_leaves_out_is_said_again(prompt: str, said: str) -> None:
    assert with_plain_phrases(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("A fallen skater picks herself up.", "A fallen skater gets up from the floor."),
        ("falls, picks himself back up off the ground", "falls, gets up from the floor"),
        ("she picks the cup up herself", "she picks the cup up herself"),
        ("a night watchman patrols", "a night watchman walks"),
        ("the sentry patrols the corridor, then waves", "the sentry walks along the corridor, then waves"),
        ("patrolling the yard", "walking along the yard"),
        ("a patrol officer waves", "a patrol officer waves"),
        ("peeks out, drops back down", "peeks out, crouches down"),
        ("is shot and drops back down", "is shot and drops back down"),
        ("folds over, then comes up and waves at us", "folds over, then waves at us"),
        ("lie down, rest for 4 seconds, sit up", "lie down, wait for 4 seconds, sit up"),
        ("kneels and inspects the tracks", "kneels and looks down at the ground"),
        ("inspects the engine", "inspects the engine"),
        ("high knees, then a bow", "run in place with high knees, then a bow"),
        ("runs with high knees", "runs with high knees"),
        ("leaps backwards over a crate, landing softly", "leaps backwards"),
        ("jumps back over the fence", "jumps back over the fence"),
        ("a woman twirls and freezes.", "a woman twirls, then stands still."),
        (
            "stab with the sword, step back into guard",
            "stab with the sword, step back, then stand on guard with the sword",
        ),
        ("jabs, steps back into a fighting stance", "jabs, steps back, then takes a fighting stance"),
        ("steps back into the room", "steps back into the room"),
    ],
)
def test_other_phrases(prompt: str, said: str) -> None:
    assert with_plain_phrases(prompt) == said


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("pushes a boulder up the hill", "pushes a boulder"),
        ("a man shoves a cart up a steep ramp, then rests", "a man shoves a cart, then rests"),
        ("walks up the hill", "walks up the hill"),
    ],
)
def test_who_pushes_a_thing_uphill_does_not_climb(prompt: str, said: str) -> None:
    assert with_plain_phrases(prompt) == said
