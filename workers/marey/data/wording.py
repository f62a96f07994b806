"""Adaptation of human captions to a changed clip: mirrored, travelling, repeated, or retimed."""

from __future__ import annotations

import re

_SIDES = re.compile(
    r"\b(?P<counter>counter-?|anti-?)?(?P<turn>clockwise)\b"
    r"|(?<!\bhad )(?<!\bhas )(?<!that is )\b(?P<side>left|right)(?=(?:ward|wards|y|s|ish|most)?\b)",
    re.IGNORECASE,
)
_VERY = re.compile(r"(?P<before>\S+ )?\bright (?=(?:down|away|there|where|up to|after|underneath|on top|back to)\b)")
"""Matches `right` as an adverb (`right down`), as opposed to a side (`from the right down`)."""
_OWNERS = ("the ", "his ", "her ", "its ", "their ", "your ", "turn ", "turns ", "turning ")
_OTHER = {"left": "right", "right": "left"}


def mirrored(text: str) -> str:
    """Adapt a caption to the mirror image: exchange left and right, and directions of rotation."""
    adverbs = {
        found.start() + len(found["before"] or "")
        for found in _VERY.finditer(text)
        if (found["before"] or "").lower() not in _OWNERS
    }

    def other(found: re.Match[str]) -> str:
        if found["turn"]:
            said = found["turn"] if found["counter"] else f"counter{found['turn'].lower()}"
        elif found.start() in adverbs:
            return found[0]
        else:
            said = _OTHER[found["side"].lower()]
        return said.capitalize() if found[0][0].isupper() else said

    return _SIDES.sub(other, text)


_STAYS = re.compile(
    r",? ?\b(?:but |yet |and |while )?(?:stays? |staying |done |all )?"
    r"(?:in place|on the spot|on spot|in its place)\b(?! \w)",
    re.IGNORECASE,
)
_STILL_STAYS = re.compile(
    r"\b(?:place|spot|stay|treadmill|stationary|nowhere|anywhere|way made|no way|not? (?:travel|moving)"
    r"|without (?:travel|moving|going)|keeps? its|kept\b(?! in)|remain)",
    re.IGNORECASE,
)
_CYCLE = re.compile(
    r",? ?\b(?:for |through |just )?(?:one|a|a single|a full|one full|one whole) cycle\b(?! of)", re.IGNORECASE
)
_STILL_CYCLE = re.compile(r"\bcycle|\b(?:one|single) (?:stroke|breaststroke|stride|step)\b", re.IGNORECASE)
_PACE = re.compile(r"\b(?:seconds?|m/s|speed of|metres? a second|meters? (?:a|per) second)\b", re.IGNORECASE)
_PARTED = re.compile(r"^[\s,;]+|[\s,;]+$")


def travelling(text: str) -> str | None:
    """Adapt a caption of a gait on the spot to one that travels; None if the place cannot be removed."""
    return _without(text, _STAYS, _STILL_STAYS)


def repeated(text: str) -> str | None:
    """Adapt a caption of one cycle to several; None if the count cannot be removed."""
    return _without(text, _CYCLE, _STILL_CYCLE)


def retimed(text: str) -> str | None:
    """Adapt a caption to a slower or faster clip; None if it gives the duration or speed in numbers."""
    return None if _PACE.search(text) else text


def _without(text: str, phrase: re.Pattern[str], rest: re.Pattern[str]) -> str | None:
    """Remove a phrase; None if the rest still has the same statement in other words."""
    left = _PARTED.sub("", phrase.sub("", text))
    left = re.sub(r"\s+([.,;])", r"\1", left)
    if not left.strip(" .") or rest.search(left):
        return None
    return left[:1].upper() + left[1:] if text[:1].isupper() else left
