"""Feet that slip or trip, read as falls."""

from __future__ import annotations

import pytest

from marey.text.lost_footing import with_falls


@pytest.mark.parametrize(
    "prompt",
    [
        "a nurse slips on the stairs",
        "a chef slips in some oil and crashes onto the floor",
        "slipping on the icy pavement",
        "they lose their footing",
        "a boy trips over his own feet",
        "the waiter trips on a rug and drops to the floor",
        "the man slipped on a puddle, landed on his side",
    ],
)
def test_feet_that_slip_or_trip_end_in_a_fall(prompt: str) -> None:
    read = with_falls(prompt)
    assert "fall" in read.split(" on the ")[0]
    assert not any(word in read for word in ("slips", "trips", "crashes", "drops", "landed"))


@pytest.mark.parametrize(
    "prompt",
    [
        "the boxer slips to the left",
        "slips into a robe",
        "she slips past the guard",
        "slips a note under the door",
        "slips on a jacket",
        "nearly slips on the ice",
        "slips on the ice but regains his balance",
        "trips over a root and then catches herself",
        "slips on a banana peel and catches himself",
        "slips on the wet deck, arms flailing, recovers his balance",
        "goes on a trip",
        "loses his temper",
    ],
)
def test_who_slips_away_or_catches_the_balance_does_not_fall(prompt: str) -> None:
    assert with_falls(prompt) == prompt


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a person is knocked down and gets back up", "a person falls to the ground and gets back up"),
        ("he gets thrown backwards by a blast, then rolls", "he falls backwards, then rolls"),
        ("the boxer is floored by a punch and gets up", "the boxer falls to the ground and gets up"),
        ("she is swept off her feet", "she falls to the ground"),
        ("being shoved over", "falling to the ground"),
        ("he is pushed to the left onto the floor", "he falls to the left"),
        ("an explosion knocks him off his feet, he crawls away", "he falls to the ground, he crawls away"),
    ],
)
def test_a_body_that_is_knocked_down_falls(prompt: str, read: str) -> None:
    assert with_falls(prompt) == read


@pytest.mark.parametrize(
    "prompt",
    [
        "he is pushed backwards",
        "the ball is thrown to the left",
        "a wrestler throws him to the ground",
        "he almost is knocked down",
        "she knocks on the door",
    ],
)
def test_who_is_pushed_or_throws_another_does_not_fall(prompt: str) -> None:
    assert with_falls(prompt) == prompt
