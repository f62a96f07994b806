"""The side of a drawn movement whose prompt names a limb that is not simply the one that acts: the knee that stays
up of who kneels, the hand at the string of an archer, the forearm that wipes."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from marey.posing.standing import OTHER_SIDE
from marey.selector.limbs import limb_of

_OF = r"(?:(?:his|her|their|its|the|a|one)\ )?"
_KNEE = re.compile(
    r"""\b(?P<side>left|right)\ (?:knee|leg|shin)\b
    (?P<up>(?:\ is|\ stays|\ kept|\ held)?\ (?:up\b|raised|forwards?|ahead|in\ front))?""",
    re.VERBOSE,
)
_FOOT_AHEAD = re.compile(
    r"""\b(?P<side>left|right)\ (?:foot|leg)\ (?:is\ |flat\ |planted\ |stays\ )*
    (?:forwards?|ahead|in\ front|on\ the|flat|planted)""",
    re.VERBOSE,
)
_BOW_HAND = re.compile(
    rf"""\bbow\ (?:is\ )?(?:held\ )?(?:firmly\ )?(?:in|with|by)\ {_OF}(?P<held>left|right)\b
    |\b(?P<arm>left|right)\ (?:bow\ )?(?:arm|hand)\ (?:\w+\ )?
    (?:holds|holding|grips|gripping|extended|stretched|outstretched)\b
    |\b(?P<bow>left|right)[ -]bow\ (?:arm|hand)\b|\bbow\ (?:arm|hand)\ (?:is\ )?(?:the\ )?(?P<named>left|right)\b""",
    re.VERBOSE,
)
_HOLDS_BOW = re.compile(
    rf"""\b(?:holds?|holding|grips?|gripping|raises?|lifts?)\ {_OF}(?:\w+\ )?bow\ (?:up\ |out\ |high\ )?
    (?:in|with)\ {_OF}(?P<side>left|right)\b""",
    re.VERBOSE,
)
_STRING = re.compile(
    rf"""\b(?:string|arrow|bowstring|draws?|drawing|pulls?|pulling)\b[^,;.]*?
    \b(?:with|by|in|using|to)\ {_OF}(?P<side>left|right)\b
    |\b(?P<handed>left|right)[ -]handed\b""",
    re.VERBOSE,
)
_DRAWS = re.compile(r"\bdraws? (?:(?:a|the|his|her|their) )?(?:\w+ )?$")
"""Words before a bow that the hand which is named draws."""


def _kneeling(text: str) -> str:
    """Return the side of the knee on the floor; empty if the words leave it open."""
    ahead = _FOOT_AHEAD.search(text)
    if ahead is not None:
        return OTHER_SIDE[ahead["side"]]
    named = {OTHER_SIDE[found["side"]] if found["up"] else found["side"] for found in _KNEE.finditer(text)}
    return named.pop() if len(named) == 1 else ""


def _bow_arm(text: str) -> str:
    """Return the side of the arm that holds the bow: the other one than that at the string."""
    holds = _HOLDS_BOW.search(text)
    if holds is not None:
        return holds["side"]
    arm = _BOW_HAND.search(text)
    if arm is not None and not text[: arm.start()].rstrip().endswith(
        ("draws a", "draws the", "draws his", "draws her")
    ):
        return next(side for side in arm.groups() if side)
    string = _STRING.search(text)
    limb = limb_of(text, "draw-bow")
    named = (string["side"] or string["handed"]) if string else limb.side if limb else ""
    return OTHER_SIDE.get(named, "")


def _hand(text: str) -> str:
    """Return the side of the arm that a text names alone."""
    limb = limb_of(text)
    return limb.side if limb is not None and limb.part == "hand" else ""


_SIDES: Mapping[str, Callable[[str], str]] = {
    "kneel": _kneeling,
    "draw-bow": _bow_arm,
    **dict.fromkeys(("wash", "slash", "stab", "pick-up"), _hand),
}


def drawn_side(prompt: str, action: str) -> str | None:
    """Return the side, `left` or `right`, of the drawn movement that a prompt asks for; empty if its words leave it
    open, None of actions whose side is that of the limb that acts, or that have none.

    Args:
        prompt: as a user typed it.
        action: id in the vocabulary.
    """
    find = _SIDES.get(action)
    return None if find is None else find(prompt.lower())
