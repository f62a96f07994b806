"""Blows whose prompt states which part of the body they strike, on which side, or that they make it stagger."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

from marey.drawing.dodges import flinch
from marey.drawing.gesture import Gesture
from marey.drawing.staggers import stagger
from marey.generation.fine_wish import FineWish
from marey.vocabulary.counts import stated_things

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
_STEPS = frozenset({"step", "steps", "paces", "pace"})
_TRAVELS = re.compile(
    r"\b(?:stagger|stumbl|reel|recoil|totter|lurch|stepp?|knock|push|driv|thrown?|send|sent|shov|forc)\w*\b[^,.;]*?"
    r"\b(?P<way>back(?:wards?)?|forwards?|sideways|to (?:the|his|her|their) (?P<side>left|right))\b"
)
"""Words of steps that a blow makes a body take, and their way."""
_SOME_STEPS = re.compile(
    r"\b(?:a few|some|several|a couple of) (?:\w+ )?(?:steps|paces)\b"
    r"|\b(?:stagger|stumbl|reel|lurch)\w* back(?:wards?)? (?:after|from|when|as|because)\b"
)
MOST_STEPS, FEW_STEPS = 8, 3


def states_hit(prompt: str) -> bool:
    """Return True if a prompt says where a blow hits, or that it makes the body go some steps."""
    return bool(hit_part(prompt)) or _steps(prompt.lower()) is not None


def _steps(text: str) -> int | None:
    """Return the steps that a blow makes a body take; None = it stays where it is, or the words do not say."""
    number = stated_things(text, _STEPS) or (FEW_STEPS if _SOME_STEPS.search(text) else None)
    return None if number is None else min(max(number, 1), MOST_STEPS)


def hit_part(prompt: str) -> str:
    """Return the part of the body that a prompt says is hit (`marey.drawing.dodges.flinch`); empty if it names none."""
    text = prompt.lower()
    return next((part for part, words in _PARTS.items() if words.search(text)), "")


def stated_hit(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return what a blow does to the part that a prompt names, or the steps that it makes the body take; None if it
    names neither."""
    del seconds
    part, text = hit_part(wish.prompt), wish.prompt.lower()
    steps = _steps(text)
    if steps is not None:
        goes = _TRAVELS.search(text)
        way = "ahead" if goes and goes["way"].startswith("forward") else (goes and goes["side"]) or "back"
        return stagger(rng, way, steps=steps, brief=any(wish.beside), struck=True)
    if not part:
        return None
    named = _SIDE_NAMED.search(text)
    heavy = bool(_HEAVY.search(text))  # otherwise the body comes back to where it stood
    return flinch(rng, part, side=wish.side or (named[1] if named else ""), heavy=heavy, times=min(wish.count or 1, 4))
