"""Numbers, turns by turns and places of movements and work, noted behind their names."""

from __future__ import annotations

import pytest

from marey.vocabulary.bearing_words import BarePrompt
from marey.vocabulary.gazes import stated_gaze


@pytest.mark.parametrize(
    ("prompt", "times"),
    [
        ("burpees x3", 3),
        ("burpees x 4", 4),
        ("burpees ×3", 3),
        ("3x burpees", 3),
        ("burpees: 5 reps", 5),
        ("burpees (x3)", 3),
        ("does burpees, three times", 3),
        ("lunges x4", 4),
        ("tennis serve x2", 2),
        ("burpees", None),
        ("burpees, 3 seconds", None),
    ],
)
def test_a_number_noted_beside_a_movement_is_its_number(prompt: str, times: int | None) -> None:
    bare = BarePrompt.of(prompt)
    assert (bare.stated[0].times, bare.text if times else "") == (times, "")


@pytest.mark.parametrize(
    "prompt",
    ["lunges, alternating legs", "lunges (alternating)", "lunges, left leg then right leg", "lunges, each leg"],
)
def test_legs_by_turns_belong_to_the_movement(prompt: str) -> None:
    (stated,) = BarePrompt.of(prompt).stated
    assert (stated.name, stated.words, stated.side) == ("lunges", prompt.removesuffix(")") + ")" * ("(" in prompt), "")


@pytest.mark.parametrize(
    ("prompt", "above"),
    [
        ("hammers a nail into a plank overhead", True),
        ("hammering above his head", True),
        ("saws a branch overhead", True),
        ("painting the ceiling", True),
        ("hammers a nail into the wall", False),
        ("paints the fence", False),
    ],
)
def test_work_may_be_over_the_head(prompt: str, above: bool) -> None:
    (stated,) = BarePrompt.of(prompt).stated
    assert stated.is_overhead is above


@pytest.mark.parametrize(
    ("prompt", "left", "name"),
    [
        ("strafe right, rifle up", "strafe right", "rifle-aimed"),
        ("backs up, rifle aimed", "backs up", "rifle-aimed"),
        ("walk forward, pistol up", "walk forward", "pistol-aimed"),
        ("runs while swatting away bees", "runs", "swatting"),
        ("swats at flies", "", "swatting"),
        ("opens the curtains", "", "curtains-opened"),
        ("pulls the curtains apart", "", "curtains-opened"),
        ("draws the curtains shut", "", "curtains-closed"),
        ("volleyball spike", "", "volleyball-spike"),
        ("spikes the ball", "", "volleyball-spike"),
    ],
)
def test_notes_of_what_the_hands_do(prompt: str, left: str, name: str) -> None:
    bare = BarePrompt.of(prompt)
    assert (bare.text, [each.name for each in bare.stated]) == (left, [name])


@pytest.mark.parametrize(
    ("prompt", "glance"),
    [
        ("look back over left shoulder", "behind_left"),
        ("glance over right shoulder", "behind_right"),
        ("look over shoulder", "behind"),
        ("stop, look back over left shoulder", "behind_left"),
    ],
)
def test_gazes_of_commands_need_no_possessive(prompt: str, glance: str) -> None:
    assert stated_gaze(prompt) == (glance,)
