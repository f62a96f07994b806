"""The leg that hurts in the words of a limp: "wounded left leg", "favouring the right", "on her good right foot"."""

from __future__ import annotations

import re
from typing import Literal

_LEG = r"(?:legs?|foot|feet|ankle|knee|hip|thigh|calf|shin|toes?|heel|hamstring)"
_BETWEEN = r"(?:[a-z]+[- ]){0,2}?"
_SOUND = r"(?:good|sound|healthy|strong|uninjured|unhurt|unharmed|better|intact)"
_SPARES = (
    r"(?:(?:favou?r|spar|nurs|bab(?:y|ie)|protect|drag)(?:s|es|e|ing|ed)?"
    r"|(?:limp|hobbl)(?:s|es|e|ing|ed)? (?:badly |heavily |slightly )?(?:on|with|in|from)|limp)"
)
_PATTERNS = tuple(
    re.compile(pattern)
    for pattern in (
        rf"(?P<before>(?:[a-z']+ ){{0,3}})\b(?P<side>left|right)[- ]{_BETWEEN}{_LEG}\b",
        rf"(?P<before>(?:[a-z']+ ){{0,3}})\b{_LEG} (?:on (?:the|his|her|its|their) )?(?P<side>left|right)\b",
        rf"(?P<before>\b{_SPARES} (?:(?:the|his|her|its|their) )?"
        rf"(?:{_SOUND} |bad |hurt |injured )?)(?P<side>left|right)\b(?! (?:hand|arm|fist|elbow|shoulder|and|then|to))",
    )
)
_GOOD = re.compile(rf"\b{_SOUND}\b")
_ACTS = re.compile(r"\b(?:kick|stamp|stomp|step|lead|start|hop|push|jump|stand|balanc|sweep)\w*\b")
"""Words of a leg that does something else than to hurt."""
OTHER: dict[str, Literal["left", "right"]] = {"left": "right", "right": "left"}


def hurt_leg(text: str) -> Literal["left", "right", ""]:
    """Return the side of the leg that hurts, as a prompt of a limp says it; empty if it names none, or both.

    Who favours a leg spares it: that one hurts, unless it is said to be the good one.

    Args:
        text: of the prompt, in small letters.
    """
    found = set[Literal["left", "right"]]()
    for pattern in _PATTERNS:
        for match in pattern.finditer(text):
            side = match["side"]
            if _ACTS.search(match["before"]):
                continue
            own: Literal["left", "right"] = "left" if side == "left" else "right"
            found.add(OTHER[own] if _GOOD.search(match[0]) else own)
    return found.pop() if len(found) == 1 else ""


def without_hurt_leg(text: str) -> str:
    """Return a text in small letters without the words of a leg that hurts, whose side is no way."""
    for pattern in _PATTERNS:
        text = pattern.sub(" ", text)
    return text
