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
