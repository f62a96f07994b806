"""The hand that draws a blade, by where the sheath is: a sword at the left hip is drawn across the body, by the right
hand."""

from __future__ import annotations

import re
from typing import Literal

_WORN = re.compile(
    r"\b(?:swords?|blade|katana|sabre|saber|rapier|cutlass|longsword|broadsword|scimitar|dagger|knife|weapon)\b.*?"
    r"\b(?P<side>left|right) (?:\w+ )?(?P<place>hip|side|waist|belt|sheath|scabbard|boot|thigh|shoulder|back)\b"
)
_HAND = re.compile(r"\b(left|right)[ -]hand")
_SAME_SIDE = frozenset({"boot", "thigh", "shoulder", "back"})
"""Places that the hand of their own side reaches."""


def drawing_hand(words: str) -> Literal["left", "right", ""]:
    """Return the hand for a blade whose sheath is on a side, by words of how it is drawn; empty if they name no
    sheath's side."""
    worn = _WORN.search(words)
    if worn is None:
        return ""
    hand = _HAND.search(words)
    acts = hand[1] if hand else worn["side"]
    crosses = hand is None and worn["place"] not in _SAME_SIDE
    return "left" if (acts == "left") != crosses else "right"
