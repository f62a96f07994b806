"""How long a prompt has a body hold the pose that it has come to: "squats and holds it for two seconds"."""

from __future__ import annotations

import re

USUAL_S, MOST_S = 1.5, 10.0
"""Seconds of a pose that is held for no stated time, and at most."""
_NUMBERS = {
    word: number
    for number, word in enumerate(["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"], 1)
}
_HELD = re.compile(
    r"\b(?:holds?|holding|keeps?|keeping|maintains?|maintaining) "
    r"(?:it|(?:the|that|this|his|her|their) (?:pose|position|posture|stretch|bow|squat|crouch|reach|lift))"
    r"(?: (?:there|still|steady))*(?! (?:in|on|with|by|to|up|down|out|above|over|against)\b)"
    rf"(?: for (?:about |around )?(?P<number>\d{{1,2}}(?:\.\d)?|a|{'|'.join(sorted(_NUMBERS, key=len, reverse=True))}) "
    r"(?P<unit>seconds?|secs?|s|moment|while)\b)?"
)


def held_pose(prompt: str) -> float | None:
    """Return the seconds for which a prompt has a pose held; None = it asks for none.

    Args:
        prompt: as a user typed it.
    """
    return (stated_hold(prompt) or USUAL_S) if _HELD.search(prompt.lower()) else None


def stated_hold(prompt: str) -> float | None:
    """Return the seconds that a prompt names for which a pose is held; None = it names none.

    Args:
        prompt: as a user typed it.
    """
    found = _HELD.search(prompt.lower())
    if found is None or found["number"] is None or found["unit"] in ("moment", "while"):
        return None
    seconds = 1.0 if found["number"] == "a" else float(_NUMBERS.get(found["number"], 0) or found["number"])
    return min(seconds, MOST_S)


def without_held_pose(prompt: str) -> str:
    """Return a prompt without the words of a pose that is held: their seconds are no length of the motion."""
    return _HELD.sub(lambda found: " " * len(found[0]), prompt.lower()) if _HELD.search(prompt.lower()) else prompt
