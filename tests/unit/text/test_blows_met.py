"""Blows that a body takes or evades."""

from __future__ import annotations

import pytest

from marey.text.blows_met import with_blows_met
from marey.text.misleading_words import without_misleading


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("takes a blow to the stomach", "gets hit in the stomach"),
        ("A knight taking a heavy arrow to the chest", "A knight getting hit in the chest"),
        ("staggers when punched", "gets hit"),
        ("she stumbles sideways after being kicked in the ribs", "she gets hit in the ribs"),
        ("reels from a left hook to the jaw", "gets hit in the jaw"),
        ("A heavy hit makes him stagger", "he gets hit"),
        ("the punch sends the boxer reeling back", "the boxer gets hit"),
        ("The man's head snaps back as a fist connects", "The man gets hit"),
    ],
)
def test_who_takes_a_blow_gets_hit(prompt: str, told: str) -> None:
    assert with_blows_met(prompt) == told


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("sidesteps a blow", "dodges a blow"),
        ("She is sidestepping an incoming punch", "She is dodging an incoming punch"),
        ("leans away from a sword swing", "dodges an attack"),
        ("he dodges a spear and runs", "he dodges an attack and runs"),
        ("evading a quick knife thrust", "evading an attack"),
        ("steps quickly to the right to avoid being hit", "dodges to the right"),
        ("twists aside to let the spear pass", "dodges"),
        ("pulls back just in time as a fist flies past", "dodges back"),
        ("backs off quickly from a knife thrust", "dodges an attack"),
        ("evasive sidestep right", "dodge right"),
        ("a boxer rolls under a punch", "a boxer ducks under a punch"),
    ],
)
def test_who_evades_a_blow_dodges(prompt: str, told: str) -> None:
    assert with_blows_met(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "takes a step to the left",
        "takes a shot at the basket",
        "takes a hook to the wall",
        "staggers back from a blow",
        "a drunk staggers home after a party",
        "The punch sends him reeling to the floor",
        "sidesteps to the left",
        "sidesteps a puddle",
        "rolls under a gate",
        "turns as an arrow flies past",
        "gets hit in the back from a punch",
        "steps away from the table",
        "throws a punch and steps back",
    ],
)
def test_what_meets_no_blow_stays(prompt: str) -> None:
    assert with_blows_met(prompt) == prompt


def test_they_are_told_before_a_prompt_is_read() -> None:
    assert without_misleading("leans away from a sword swing") == "dodges an attack"
    assert without_misleading("reels from a hook and falls") == "reels from a hook and falls", "it is hit, and falls"


@pytest.mark.parametrize("limb", ["left arm", "forearm", "hand", "right knee"])
def test_a_blow_to_a_limb_is_no_block_and_no_kick(limb: str) -> None:
    assert without_misleading(f"A person gets shot in the {limb}") == "A person gets hit"
    assert without_misleading("A person gets hit in the chest") == "A person gets hit in the chest"
