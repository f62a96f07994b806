"""Raised arms whose height, direction or end a prompt states.

A network lifts a hand over the head, wherever it is to go, and some of its motions do so twice.
"""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.raises import FRONT, SIDE, Raise, raise_to
from marey.generation.fine_wish import FineWish
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.held_poses import stated_hold
from marey.vocabulary.lengths import stated_length

_LOWERS = re.compile(
    r"\b(?:lower(?:s|ed|ing)?|drop(?:s|ped|ping)?|let(?:s|ting)? (?:it|them|the arms?) (?:down|drop|fall)"
    r"|(?:bring|put|take|set|return|come|go|move)(?:s|ing)? (?:(?:it|them|the (?:arm|hand)s?) )?(?:back )?"
    r"(?:down|to rest)"
    r"|back (?:down|to (?:rest|the sides?|(?:his|her|their|its) sides?))|down again|and down)\b"
)
"""Words of the end of a raise."""
_KEEPS = re.compile(
    r"\b(?:keep|hold|leave|maintain)(?:s|ing)?\b|\bstay(?:s|ing)?\b|\bremain(?:s|ing)?\b|\bheld\b|\bkept\b|\bfreez\w*"
)
_OF = r"(?: of)?(?: (?:his|her|their|its|your|my|the|one's))?"
_PARTS: Mapping[str, str] = {
    "waist": r"waists?|hips?|belly|navel|stomach|belt",
    "chest": r"chests?|breast|sternum",
    "shoulder": r"shoulders?",
    "head": r"heads?|face|ears?|eyes?|chin|forehead|temple",
}
_HEIGHT: Mapping[str, re.Pattern[str]] = {
    "overhead": re.compile(
        rf"\boverhead\b|\b(?:above|over){_OF} heads?\b|\bstraight up\b|\b(?:to|at|towards?) the (?:sky|ceiling)\b"
    ),
    **{
        height: re.compile(
            rf"\b(?:{part})[ -](?:height|level|high)\b|\b(?:height|level with|level|front){_OF} (?:{part})\b"
        )
        for height, part in _PARTS.items()
    },
    "surrender": re.compile(r"\bsurrender\w*"),
}
"""Words of heights; the first that fits counts."""
_LEVEL = re.compile(
    r"\b(?:horizontal\w*|parallel (?:to|with) the (?:floor|ground)|t[ -](?:shape|pose)|(?:like|into|in) a t\b"
    r"|90 degrees|(?:up )?to (?:the |his |her |their )?shoulders?\b|lateral(?:ly)? (?:arm )?rais\w*)"
)
"""Words of an arm at the height of the shoulders."""
_FRONT = re.compile(
    r"\b(?:forwards?|(?:in|to|at|out) (?:the )?front|ahead|out front|before (?:him|her|them)(?:sel\w+)?)\b"
)
_SIDE = re.compile(
    r"\b(?:to (?:the|his|her|their|its|each|both|either|one) (?:(?:left|right) )?sides?(?! of)"
    r"|to (?:the|his|her) (?:left|right)|at (?:the|his|her|their) sides?"
    r"|sideways?|sidewards?|lateral\w*|outwards?|aside|apart|wide|t[ -](?:shape|pose)"
    r"|(?:like|into|in) a t)\b"
)
_BOTH = re.compile(r"\b(?:both|arms|hands|fists|left and right|right and left|each)\b")
_SIDE_NAMED = re.compile(r"\b(left|right)(?:[ -]hand(?:ed)?)? ?(?:arm|hand|fist|palm|limb)?\b")
_ARM = r"(?:arms?|hands?)"
_STRETCHES = re.compile(
    rf"\b(?:extend|stretch|hold|spread|lift|raise|put|stick|open)(?:s|es|ing)? (?:[\w']+ ){{0,3}}?{_ARM}\b"
    rf"|\b{_ARM} (?:[\w']+ ){{0,2}}?(?:out|extended|stretched|raised|lifted|outstretched)\b"
    r"|\blateral raise\b|^t[ -]pose\b"
)
"""Words of an arm that is raised, if a height or a direction is beside them."""
_OTHER = re.compile(
    r"\b(?:walk|run|jog|jump|danc|sit|kneel|crouch|turn|spin|balanc|lean|wav|clap|grab|take|pick|give"
    r"|hand \w+ (?:a|the))"
)
"""Words of what else a body does that stretches out an arm."""


def stated_action(prompt: str) -> str:
    """Return the id of an action that only the words of this module name, `raise-arm`; empty if they name none, or arms
    that are a bearing."""
    text = prompt.lower()
    states = _height_of(text) or _FRONT.search(text) or _SIDE.search(text)
    if not states or not _STRETCHES.search(text) or _OTHER.search(text) or stated_bearings(prompt):
        return ""
    return "raise-arm"


def stated_raise(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the raise whose height or direction a prompt states, or that it says ends; None if it states none."""
    del seconds  # it rests at the end
    text = wish.prompt.lower()
    lowers = _LOWERS.search(text)
    up = text[: lowers.start()] if lowers else text
    height, front, aside = _height_of(up), _FRONT.search(up), _SIDE.search(up)
    if not (height or front or aside or lowers):
        return None
    height = height or ("shoulder" if front or aside else "overhead")
    way = FRONT if front else SIDE if aside else rng.choice((FRONT, SIDE))
    named = _SIDE_NAMED.search(up)
    side = wish.side or (BOTH if _BOTH.search(up) else named[1] if named else rng.choice(SIDES))
    if height == "surrender":
        return raise_to(rng, Raise(BOTH, "head", SIDE, keeps=not lowers))
    kept = _KEEPS.search(up)
    said = up[kept.start() :] if kept else ""
    hold = stated_length(said).seconds or stated_hold(said)
    return raise_to(rng, Raise(side, height, way, wish.count or 1, bool(kept and not lowers), hold))


def _height_of(text: str) -> str:
    """Return the height that a text states for a hand; empty if it states none."""
    found = next((height for height, words in _HEIGHT.items() if words.search(text)), "")
    return found or ("shoulder" if _LEVEL.search(text) else "")
