"""Captions by people, made true of a changed clip: mirrored, made to travel, repeated, or retimed."""

from __future__ import annotations

import re

_SIDES = re.compile(
    r"\b(?P<counter>counter-?|anti-?)?(?P<turn>clockwise)\b"
    r"|(?<!\bhad )(?<!\bhas )(?<!that is )\b(?P<side>left|right)(?=(?:ward|wards|y|s|ish|most)?\b)",
    re.IGNORECASE,
)
_VERY = re.compile(r"(?P<before>\S+ )?\bright (?=(?:down|away|there|where|up to|after|underneath|on top|back to)\b)")
"""`right down` is no side, but `from the right down` is one."""
_OWNERS = ("the ", "his ", "her ", "its ", "their ", "your ", "turn ", "turns ", "turning ")
_OTHER = {"left": "right", "right": "left"}


def mirrored(text: str) -> str:
    """A caption of the mirror image: left and right, and the ways round, exchanged."""
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
    """A caption of a gait on the spot, said of one that travels; None where it cannot be said without its place."""
    return _without(text, _STAYS, _STILL_STAYS)


def repeated(text: str) -> str | None:
    """A caption of one cycle, said of several of them; None where it counts the cycle in its own words."""
    return _without(text, _CYCLE, _STILL_CYCLE)


def retimed(text: str) -> str | None:
    """A caption of a slower or faster clip: the same, but for one that says how long or how fast in numbers."""
    return None if _PACE.search(text) else text


def _without(text: str, phrase: re.Pattern[str], rest: re.Pattern[str]) -> str | None:
    """The text without a phrase, if nothing is left that says it in other words."""
    left = _PARTED.sub("", phrase.sub("", text))
    left = re.sub(r"\s+([.,;])", r"\1", left)
    if not left.strip(" .") or rest.search(left):
        return None
    return left[:1].upper() + left[1:] if text[:1].isupper() else left
