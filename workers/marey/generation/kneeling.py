"""Bodies that drop to their knees, as their prompts say, instead of kneeling down one knee after the other."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.knee_drops import drop_to_knees
from marey.generation.fine_wish import FineWish
from marey.vocabulary.bearing_words import stated_bearings

_DROPS = re.compile(
    r"\b(?:drop|fall|fell|sink|sank|sunk|collaps|crumpl|crumbl|slump|crash|slam|tumbl|plung)\w*\b"
    r"(?:,? (?!(?:the|an?|his|her|their)\b)(?:\w+)| the (?:ground|floor)){0,5}?"
    r"(?: (?:the|his|her|their|its|both|two|bended))* knees\b"
    r"|\bknees (?:\w+ )?(?:buckl|giv|gave|fold|collaps)\w*|\bkneel\w* (?:down )?quickly on both knees\b"
)
_SLOWLY = re.compile(r"\b(?:s(?:ink|ank|unk)\w*|slow\w*|gradual\w*|gently|carefully)\b")
_ONE = re.compile(r"\bone knee\b")
STAYS_S, GRIEVES_S = (1.3, 2.0), (3.4, 4.4)
"""Seconds on the knees, and those of who weeps or does something else there."""


def drops(text: str) -> bool:
    """Return True if a body drops to both knees.

    Args:
        text: in lower case.
    """
    return bool(_DROPS.search(text)) and not _ONE.search(text)


def drops_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the drop to both knees that a prompt asks for; None if the body kneels down in another way."""
    text = wish.prompt.lower()
    if not drops(text):
        return None
    before, after = wish.beside
    stays = rng.uniform(*(GRIEVES_S if stated_bearings(wish.prompt) else STAYS_S))
    starts = 0.06 if before else rng.uniform(0.25, 0.45)
    slow = bool(_SLOWLY.search(text))
    if seconds is not None:
        stays = max(seconds - starts - (1.2 if slow else 0.65), 0.8)
    return drop_to_knees(rng, slow=slow, stays=0.9 if after and seconds is None else stays, starts=starts)
