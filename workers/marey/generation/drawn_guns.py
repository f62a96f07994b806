"""Guns that are drawn before they are aimed or fired: "draws a pistol from the hip and fires twice"."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.shots import drawn_pistol
from marey.generation.fine_wish import FineWish
from marey.vocabulary.counts import stated_number

MOST_SHOTS = 8
"""Shots at most."""
_GUN = r"(?:pistols?|hand ?guns?|guns?|revolvers?|side ?arms?|six[- ]?shooters?|glock|blasters?|weapon)"
_DRAWS = re.compile(
    rf"\b(?:(?:draw|unholster)(?:s|ing)?|(?:pull|whip|take|yank|snap)(?:s|ing)?(?: out)?)"
    rf" (?:(?!and\b|then\b)[\w-]+ ){{0,3}}?{_GUN}\b"
)
_FIRES = re.compile(r"\b(?:fir(?:es?|ing)|shoot(?:s|ing)?|shots?|unloads?)\b(?P<behind>[^,.;]*)")


def drawn_gun(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return a gun that is drawn and, if the prompt says so, fired; None if none is drawn."""
    del seconds
    text = wish.prompt.lower()
    if not _DRAWS.search(text):
        return None
    fires = _FIRES.search(text)
    shots = 0 if fires is None else wish.count or stated_number(fires["behind"]) or 1
    return drawn_pistol(rng, wish.side, min(shots, MOST_SHOTS))
