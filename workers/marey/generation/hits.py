"""Blows whose prompt states which part of the body they strike, on which side, or that they make it stagger."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

from marey.drawing.dodges import flinch
from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish

_PARTS: Mapping[str, re.Pattern[str]] = {
    "leg": re.compile(r"\b(?:legs?|thighs?|knees?|shins?|foot|ankles?|cal(?:f|ves))\b"),
    "head": re.compile(
        r"\b(?:heads?|headshot|face|jaw|chin|nose|temple|cheek|forehead|mouth|eye|neck|throat|slap\w*)\b"
    ),
    "stomach": re.compile(
        r"\b(?:stomach|bell(?:y|ies)|guts?|abdomen|midsection|solar plexus|groin|torso|waist|crotch|tummy)\b"
    ),
    "shoulder": re.compile(r"\b(?:shoulders?|(?:upper )?arms?|elbow|bicep)\b"),
    "chest": re.compile(r"\b(?:chest|breast|heart|sternum|(?:from|in|on) (?:the )?front)\b"),
    "side": re.compile(
        r"\b(?:ribs?|flank|hips?|(?:left|right|his|her|the|from one) side|kidneys?)\b|\bfrom the (?:left|right)\b"
    ),
    "back": re.compile(
        r"\bfrom (?:behind|the (?:back|rear))\b|\b(?:in|on|to|across) (?:the|his|her|their) back\b|\bback hit\b"
    ),
}
"""Words of parts of the body that are hit; the first that fits counts."""
_SIDE_NAMED = re.compile(r"\b(left|right)\b")
_HEAVY = re.compile(
    r"\b(?:hard|heav\w+|stagger\w*|stumbl\w*|reel\w*|powerful\w*|strong\w*|big|huge|violent\w*|brutal\w*"
    r"|knock\w* back\w*)\b"
)


def hit_part(prompt: str) -> str:
    """Return the part of the body that a prompt says is hit (`marey.drawing.dodges.flinch`); empty if it names none."""
    text = prompt.lower()
    return next((part for part, words in _PARTS.items() if words.search(text)), "")


def stated_hit(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return what a blow does to the part that a prompt names; None if it names none."""
    del seconds
    part, text = hit_part(wish.prompt), wish.prompt.lower()
    if not part:
        return None
    named = _SIDE_NAMED.search(text)
    heavy = bool(_HEAVY.search(text))  # otherwise the body comes back to where it stood
    return flinch(rng, part, side=wish.side or (named[1] if named else ""), heavy=heavy, times=min(wish.count or 1, 4))
