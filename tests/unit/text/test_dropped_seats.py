"""Prompts whose people drop onto a seat or a bed."""

from __future__ import annotations

import pytest

from marey.text.dropped_seats import with_seats_taken


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("limps to the couch, then flops down exhausted", "limps to the couch, then sits down heavily exhausted"),
        ("staggers to the sofa and slumps onto it", "staggers to the sofa and sits down heavily on it"),
        ("sinks wearily into an old armchair", "sits down wearily on an old armchair"),
        ("a man plopping down on a stool", "a man sitting down heavily on a stool"),
        ("collapses onto the bed", "lies down heavily on the bed"),
        ("flops down", "sits down heavily on the floor"),
        ("slumps down against the wall", "sits down on the floor"),
        ("slides down the wall to sit", "sits down on the floor"),
        ("sinks to the floor with his back against a pillar", "sits down on the floor"),
        ("leans against the wall and slides to the floor", "sits down on the floor"),
        ("a man sliding down the door, crying", "a man sitting down on the floor, crying"),
    ],
)
def test_who_drops_onto_a_seat_sits_down(prompt: str, told: str) -> None:
    assert with_seats_taken(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "drops to the floor",
        "falls dead into the chair",
        "slumped in his chair",
        "drops the box onto the chair",
        "falls off the chair",
        "leans on the table and drops onto it",
        "sinks to his knees",
        "slumped against the wall",
        "leans against the wall",
        "slides down the pole to the lower deck",
    ],
)
def test_other_falls_stay(prompt: str) -> None:
    assert with_seats_taken(prompt) == prompt
