"""Stunts in plain words: blasts, drops, ropes, ledges, recoil, landings and shoves."""

from __future__ import annotations

import pytest

from marey.text.lost_footing import THROWN_BACK
from marey.text.stunt_words import with_plain_stunts


@pytest.mark.parametrize(
    ("prompt", "said"),
    [
        ("thrown back by a blast", THROWN_BACK),
        ("knocked flat on his back by an explosion", THROWN_BACK),
        ("the bomb hurls her backwards, then she gets up", f"{THROWN_BACK}, then she gets up"),
        ("blown off his feet", THROWN_BACK),
        ("throws a grenade", "throws a grenade"),
        ("fires the shotgun and the recoil kicks his shoulder back", "fires the shotgun"),
        ("shoot a rifle twice with heavy recoil", "shoot a rifle twice"),
        ("he sees the ghost and recoils in horror", "he sees the ghost and recoils in horror"),
        ("drops from the balcony", "jumps down from the balcony"),
        ("hop down off a crate", "jump down from a crate"),
        ("drops the box on the table", "drops the box on the table"),
        ("jumps over the wall", "jumps over the wall"),
        ("balances carefully across a tightrope", "walks carefully across a tightrope"),
        ("tightrope walk", "walk along a tightrope"),
        ("crosses the street", "crosses the street"),
        ("edges to the right along the wall", "slowly sidesteps to the right along the wall"),
        (
            "hangs by his hands and shimmies left along the ledge",
            "hangs by his hands and shimmies left along the ledge",
        ),
        ("jumps over a ditch, stumbles on landing", "jumps over a ditch, then stumbles forward"),
        ("leaps over a puddle, slips on landing and falls", "leaps over a puddle, then slips and falls"),
        ("staggers back two steps after being pushed", "gets hit hard, knocked back two steps"),
        ("staggers back to the bar", "staggers back to the bar"),
        ("jump left, jump right", "jump sideways to the left, then jump sideways to the right"),
        ("jump up and land in a deep crouch", "jump up landing low"),
        ("jump and turn left", "jump and turn left"),
    ],
)
def test_stunts_are_told_in_plain_words(prompt: str, said: str) -> None:
    assert with_plain_stunts(prompt) == said
