"""How long a prompt has a body hold the pose that it has come to: "squats and holds it for two seconds"."""

from __future__ import annotations

import re

USUAL_S, MOST_S = 1.5, 10.0
"""Seconds of a pose that is held for no stated time, and at most."""
_NUMBERS = {
    word: number
    for number, word in enumerate(["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"], 1)
}
_NUMBER = rf"(?:about |around )?(?P<number>\d{{1,2}}(?:\.\d)?|a|{'|'.join(sorted(_NUMBERS, key=len, reverse=True))})"
_SPAN = rf"{_NUMBER}[ -]?(?P<unit>seconds?|secs?|s|moment|while)\b"
_POSE = r"(?:pose|position|posture|stretch|bow|squat|crouch|reach|lift|lunge|salute)"
_HOLDS = r"(?:holds?|holding|keeps?|keeping|maintains?|maintaining)"
_ARM = r"(?:arms?|hands?|fists?|fingers?)"
_HELD = tuple(
    re.compile(pattern)
    for pattern in (
        rf"(?P<hold>\b{_HOLDS} (?:it|(?:the|that|this|his|her|their) {_POSE})"
        r"(?: (?:there|still|steady))*(?! (?:in|on|with|by|to|up|down|out|above|over|against)\b)"
        rf"(?: for {_SPAN})?)",
        rf"(?P<hold>\b{_HOLDS} (?:an? (?:(?:deep|low|half|full|wide|forward|left|right) )*{_POSE}) for {_SPAN})",
        rf"(?:^|[,;.:]|\b(?:and|then)\b)\s*(?P<hold>\b(?:holds?|holding) (?:for )?{_SPAN})",
        r"\b(?:rais|lift|stretch|extend|reach|point)(?:e?s|e|ing)?\b"
        rf"(?: (?!and\b|then\b|while\b|as\b)[\w-]+){{0,3}}? {_ARM}"
        rf"(?: (?!and\b|then\b|while\b|as\b|again\b|repeatedly\b)[\w-]+){{0,5}}?(?P<hold> for {_SPAN})",
    )
)
"""Words of a pose that is held: it or the pose itself, a pose that is named, and an arm that is raised for a time."""
_SO_LONG = re.compile(rf"for {_SPAN}")


def held_pose(prompt: str) -> float | None:
    """Return the seconds for which a prompt has a pose held; None = it asks for none.

    Args:
        prompt: as a user typed it.
    """
    return None if _found(prompt) is None else stated_hold(prompt) or USUAL_S


def stated_hold(prompt: str) -> float | None:
    """Return the seconds that a prompt names for which a pose is held; None = it names none.

    Args:
        prompt: as a user typed it.
    """
    found = _found(prompt)
    return None if found is None else _seconds(found)


def _seconds(found: re.Match[str]) -> float | None:
    """Return the seconds that words of a held pose name; None = they name none."""
    if found["number"] is None or found["unit"] in ("moment", "while"):
        return None
    seconds = 1.0 if found["number"] == "a" else float(_NUMBERS.get(found["number"], 0) or found["number"])
    return min(seconds, MOST_S)


def held_words(text: str, at: int) -> tuple[float, int] | None:
    """Return the seconds of a pose that is held by the words at a place in a text, and where these end; None if none
    are there: "holds it for two seconds" or, of the gesture before it, "for two seconds".

    Args:
        text: in small letters.
        at: place in it.
    """
    hold = next((found for pattern in (*_HELD, _SO_LONG) if (found := pattern.match(text, at))), None)
    return None if hold is None else (_seconds(hold) or USUAL_S, hold.end())


def without_held_pose(prompt: str) -> str:
    """Return a prompt without the words of a pose that is held: their seconds are no length of the motion."""
    found = _found(prompt)
    if found is None:
        return prompt
    begin, end = found.span("hold")
    return f"{prompt[:begin].lower()}{' ' * (end - begin)}{prompt[end:].lower()}"


def _found(prompt: str) -> re.Match[str] | None:
    """Return the words of a pose that is held, with those that name it for some of them."""
    text = prompt.lower()
    return next((found for pattern in _HELD if (found := pattern.search(text))), None)
