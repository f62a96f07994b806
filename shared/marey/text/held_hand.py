"""The hand that has taken something, and throws it (ours)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from marey.text.sequence_reader import ReadMovement

TAKING = frozenset({"pick-up", "reach-up", "carry"})
"""Actions behind which something is in a hand."""
THROW = "throw"
_HAND = re.compile(
    r"\b(?:with|in|into|using|by) (?:(?:his|her|their|its|the|my|your|one's) )?(left|right) (?:hand|arm)\b", re.I
)
_THROWN = re.compile(r"\b(?:throw|toss|hurl|lob|fling|pitch)\w* (?:it|them|the|that)\b", re.IGNORECASE)
_SIDE = re.compile(r"\b(?:left|right|both)\b(?= (?:hand|arm))", re.IGNORECASE)


def with_held_hand(movements: Iterable[ReadMovement]) -> Iterator[ReadMovement]:
    """Yield movements; who throws what a hand has taken up does so with that hand: "picks up a stone with the left
    hand, then throws it"."""
    side = ""
    for movement in movements:
        hand = _HAND.search(movement.text)
        if movement.action in TAKING:
            side = hand[1].lower() if hand is not None else ""
        thrown = movement.action == THROW and side and _THROWN.search(movement.text)
        if thrown and not _SIDE.search(movement.text):
            movement = replace(movement, text=f"{movement.text} with the {side} hand")
        if movement.action == THROW:
            side = ""
        yield movement
