"""Dances that are asked for by name, whose basic step is drawn: networks make some dance of them."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

from marey.drawing.dances import dance_basic
from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish

_NAMES: Mapping[str, re.Pattern[str]] = {
    "salsa": re.compile(r"\b(?:salsa|mambo)\b"),
    "cha-cha": re.compile(r"\bcha[ -]?cha(?:[ -]?cha)?\b"),
    "bachata": re.compile(r"\bbachata\b"),
    "waltz": re.compile(r"\bwaltz(?:es|ing|ed)?\b"),
    "victory": re.compile(
        r"\b(?:victory|celebration|celebrat(?:ory|ing)|touchdown|winners?'?s?|triumph(?:ant)?|goal|happy|joyful)"
        r" danc(?:e|es|ing)\b"
        r"|\bdanc(?:e|es|ing) (?:in|of|for|with) (?:victory|triumph|joy|celebration|celebrating)\b|\bvictory jig\b"
    ),
    "hip-hop": re.compile(r"\bhip[ -]?hop\b(?=.*\b(?:bounc|groov|basic|two[ -]step|step[ -]touch)\w*)"),
}
"""Words of dances."""
_DANCES = re.compile(r"\b(?:danc\w*|basics?|steps?|moves?|bounc\w*|groov\w*|bachata|waltz\w*|cha[ -]?cha|mambo)\b")
"""Words of who dances, and not of a sauce."""
_FIGURES = re.compile(
    r"\b(?:turn|spin|twirl|pirouett|dip|lift|leap|jump|kick|partner|each other|across|around|through|into|out of"
    r"|towards?|along|waving)\w*\b"
)
"""Words of figures that are no basic step, and of ways."""


def named_dance(prompt: str) -> str:
    """Return the dance whose basic step a prompt asks for; empty if it names none, or more than one, or figures.

    Args:
        prompt: as a user typed it.
    """
    text = prompt.lower()
    names = [name for name, words in _NAMES.items() if words.search(text)]
    return names[0] if len(names) == 1 and not _FIGURES.search(text) and _DANCES.search(text) else ""


def dance_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the basic step of the dance that a prompt names; None if it names none. See `marey.generation.stated`."""
    name = named_dance(wish.prompt)
    if not name:
        return None
    return dance_basic(rng, name, seconds=seconds, brief=any(wish.beside))
