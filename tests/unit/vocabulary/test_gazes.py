"""Where a prompt has the head turn."""

from __future__ import annotations

import pytest

from marey.vocabulary.gazes import only_gaze, stated_gaze, without_gaze


@pytest.mark.parametrize(
    ("prompt", "gaze"),
    [
        ("a robot turns its head to the right", ("right",)),
        ("the creature looks over its shoulder", ("behind",)),
        ("she turns her head", ("around",)),
        ("turns his head slowly and waves", ("around",)),
        ("turns his head and body towards the door", ()),
        ("does not turn her head", ()),
    ],
)
def test_heads_of_creatures_turn_and_those_that_turn_nowhere_in_particular(prompt: str, gaze: tuple[str, ...]) -> None:
    assert stated_gaze(prompt) == gaze


@pytest.mark.parametrize(
    ("prompt", "gaze"),
    [
        ("look left, look right", ("left", "right")),
        ("drives and checks the left mirror", ("left",)),
        ("glances in the rear-view mirror", ("right",)),
        ("looks in the mirror", ()),
        ("walk forward, stop, look around", ("around",)),
        ("she glances over her shoulder", ("behind",)),
        ("look over the right shoulder", ("behind_right",)),
        ("turns head to look behind", ("behind",)),
        ("looks behind the sofa", ()),
        ("does a quick double-take to the right", ("twice_right",)),
        ("he does a double take", ("twice",)),
        ("looks to the left, then to the right", ("left", "right")),
        ("looks up at the sky and then down", ("up", "down")),
        ("look up at sky", ("up",)),
        ("looks up at the tall tower", ("up",)),
        ("looks up at her and down", ("up", "down")),
        ("turns her head to the right", ("right",)),
        ("looks quickly to his left", ("left",)),
        ("No: he shakes his head", ("shake",)),
        ("he looks at her", ()),
        ("walks without looking back", ()),
        ("he does not look around", ()),
        ("a good looking man turns left", ()),
        ("looks for his keys", ()),
        ("looks right at the camera", ()),
        ("looks down the street", ()),
        ("looks about to fall", ()),
        ("looks left-handed", ()),
        ("shakes a bottle", ()),
    ],
)
def test_the_gaze_of_a_prompt(prompt: str, gaze: tuple[str, ...]) -> None:
    assert stated_gaze(prompt) == gaze


@pytest.mark.parametrize(
    ("prompt", "left"),
    [
        ("a person walks while looking around", "a person walks"),
        ("sits and looks left, then right", "sits"),
        ("she walks through the forest, slowly looking left and right", "she walks through the forest"),
        ("looks up, waves and sits down", "waves and sits down"),
        ("look left, look right", ""),
        ("A man looks around", ""),
        ("shakes head no", ""),
        ("turns head to look behind while walking", "while walking"),
        ("walks without looking back", "walks without looking back"),
        ("He waves.", "He waves."),
    ],
)
def test_a_prompt_without_its_gaze(prompt: str, left: str) -> None:
    assert without_gaze(prompt) == left


@pytest.mark.parametrize(
    ("prompt", "only"),
    [
        ("looks left, then looks right", True),
        ("a guard looks around slowly", True),
        ("looks around and walks on", False),
        ("waves", False),
    ],
)
def test_a_prompt_of_a_gaze_alone(prompt: str, only: bool) -> None:
    assert only_gaze(prompt) == only


@pytest.mark.parametrize("prompt", ["look up at sky", "looks up at the old tower", "looks down at feet"])
def test_what_the_head_faces_is_part_of_the_gaze(prompt: str) -> None:
    assert only_gaze(prompt)
