"""Jumps down from something high: "drops from the balcony", "hops off a crate and lands in a crouch"."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple

_DOWN = re.compile(
    r"\b(?:(?:jump|leap|hop|spring|drop)(?:s|ped|ping|ing|ed)?|sprang|leapt) (?:\w+ly )?"
    r"(?:down (?:from|off|onto|to the (?:floor|ground|street))\b"
    r"|down(?=\W*$|[,.;]| (?:and|then|heavily|lightly)\b)"
    r"|off(?: of)? (?:the|a|an|his|her|some)\b"
    r"|from (?:the|a|an|his|her|some|above)\b(?! (?:left|right|spot|side|front|back))"
    r"(?!.* to (?:the|a|an|another) (?!floor|ground|street)))"
)
_OTHER = re.compile(r"\bup and down\b|\b(?:box|depth) jump|\bjumping off point")
_HIGH = re.compile(r"\b(?:roofs?|rooftops?|balcon\w+|building|window\w*|cliffs?|bridge|tree|tower|ladder|above|high)\b")
_LOW = re.compile(r"\b(?:box|chair|bench|step|stairs|stool|kerb|curb|tables?|crates?|stage|low|small|porch)\b")
_HEAVY = re.compile(r"\b(?:heav\w+|hard|thud\w*|superhero|ground[- ]shaking|crash\w*)\b")
_LANDS_LOW = re.compile(r"\bland\w* (?:low|(?:in|into) (?:a |an )?(?:\w+ )?(?:crouch|squat))\b|\bland\w* crouch\w+")


class StatedDrop(NamedTuple):
    """A jump down.

    Attributes:
        high: of what the body stands on; empty = about as high as the chest.
        heavy: it lands hard.
    """

    high: Literal["high", "low", ""]
    heavy: bool


def stated_drop(prompt: str) -> StatedDrop | None:
    """Return the jump down that a prompt asks for; None if it asks for none."""
    text = prompt.lower()
    if not _DOWN.search(text) or (_OTHER.search(text) and not re.search(r"\b(?:from|off)\b", text)):
        return None
    return StatedDrop("high" if _HIGH.search(text) else "low" if _LOW.search(text) else "", bool(_HEAVY.search(text)))


def lands_low(prompt: str) -> bool:
    """Return True if a jump ends in a crouch: "lands in a deep crouch"."""
    return _LANDS_LOW.search(prompt.lower()) is not None
