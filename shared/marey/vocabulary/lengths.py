"""Lengths that a prompt states in words: "for six seconds", "a 3-second idle", "2s of waving".

Standard library only. A bundle's range of lengths is not known here (`marey.bundles.limits`).
"""

from __future__ import annotations

import re
from dataclasses import dataclass

TO_TWENTY = """one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen
seventeen eighteen nineteen twenty"""
"""The numbers from 1 on in words, with blanks between them."""
_NUMBERS = {
    **{name: float(value) for value, name in enumerate(TO_TWENTY.split(), 1)},
    "thirty": 30.0,
    "forty": 40.0,
    "fifty": 50.0,
    "sixty": 60.0,
    "ninety": 90.0,
    "a": 1.0,
    "an": 1.0,
}
_WORDS = "|".join(sorted(_NUMBERS, key=len, reverse=True))
_UNIT = r"(?P<unit>seconds?|secs?|s|minutes?|mins?)"
_FULL = r"(?:(?:whole|full|entire|long|solid)[ ])?"
_LENGTH = re.compile(
    rf"""\b(?:
        (?P<half>half)[ ](?:a|of[ ]a)[ ]{_UNIT.replace("unit", "half_unit")}
      | (?P<digits>(?<![\d.,])\d{{1,3}}(?:[.,]\d+)?)[ -]?{_FULL}{_UNIT.replace("unit", "digit_unit")}
      | (?P<word>{_WORDS})(?P<and_half>[ ]and[ ]a[ ]half)?[ -]{_FULL}{_UNIT.replace("unit", "word_unit")}
        (?P<half_after>[ ]and[ ]a[ ]half)?
    )\b(?!['’])""",
    re.VERBOSE,
)
_BEFORE = re.compile(r"\b(?:after|every|each|first|last|next|another|per|within|at|than|the)(?: \w+)?[ ]$")
"""Words before a time that is a moment or a part, not a length: "after two seconds", "the first three seconds"."""
_AFTER = re.compile(r"^[ ]?(?:later|ago|in\b|apart|into|mark|hand|from now|at a time|between)")
_NEXT = re.compile(r"\b(?:then|before|after|afterwards?|followed by|finally|next)\b|[;.!?](?:\s|$)")
"""Separators of actions in the order of time."""
_DECADE = re.compile(r"[5-9]0s")
_LABEL = re.compile(r"\b(?:length|duration|total|time|lasting|takes?|overall)\b")


@dataclass(frozen=True)
class StatedLength:
    """Lengths in the words of a prompt.

    Attributes:
        seconds: of the whole motion; None = none is stated, or only that of a part.
        is_partial: a length is stated for a part of the motion, and none for the rest.
    """

    seconds: float | None = None
    is_partial: bool = False

    def within(self, low: float, high: float) -> float | None:
        """Return the length if a motion of `low` to `high` seconds can have it, else None."""
        return self.seconds if self.seconds is not None and low <= self.seconds <= high else None


def stated_length(prompt: str) -> StatedLength:
    """Return the length that a prompt states.

    Several lengths are summed where every action in order has one: "walks for two seconds, then waves for 3 s" has
    five. "walks, then waves for three seconds" states that of a part.
    """
    text = " ".join(prompt.lower().split())
    found = [match for match in _LENGTH.finditer(text) if not _is_moment(text, match)]
    if not found:
        return StatedLength()
    rest = _LENGTH.sub(" ", text)
    parts = [part for part in _NEXT.split(rest) if re.search(r"[^\W\d_]{3}", _LABEL.sub("", part))]
    if len(found) < len(parts):
        return StatedLength(is_partial=True)
    return StatedLength(sum(map(_seconds, found)))


def _is_moment(text: str, match: re.Match[str]) -> bool:
    decade = _DECADE.fullmatch(match[0]) and not text[match.end() :].startswith(" of ")
    return bool(decade or _BEFORE.search(text[: match.start()]) or _AFTER.search(text[match.end() :]))


def _seconds(match: re.Match[str]) -> float:
    if match["half"]:
        value, unit = 0.5, match["half_unit"]
    elif match["digits"]:
        value, unit = float(match["digits"].replace(",", ".")), match["digit_unit"]
    else:
        value, unit = _NUMBERS[match["word"]], match["word_unit"]
        value += 0.5 if match["and_half"] or match["half_after"] else 0.0
    return value * 60 if unit.startswith("m") else value
