"""Steps to a side as their prompts ask for: by number, for some seconds, at a pace, or a single one."""

from __future__ import annotations

import random
import re
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.sidesteps import sidestep
from marey.generation.fine_wish import FineWish
from marey.vocabulary.counts import stated_count, stated_things
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.paces import stated_pace

_TO_AND_FRO = re.compile(r"\b(?:side to side|back and forth|to and fro|left and right|right and left|both)\b")
_ONE = re.compile(
    r"\b(?:a|one|1|single|quick|slow|big|small|little) side[ -]?step\b|^\W*side[ -]?step\b"
    r"|\b(?:a|one|1|single) (?:(?!few|couple)\w+ )?(?:step|pace|stride)\b"
    r"|(?<!\bside)(?<!side-)(?<!\bside )\bstep(?:s|ped)? (?:\w+ly )?(?:out )?(?:to (?:the|his|her|their|your|my|one) )?"
    r"(?:left|right|side|sideways|aside)\b(?! (?:and|then) (?:step|again))"
    r"|\bside[ -]?step(?:s|ped)?\b(?= (?:\w+ly )?(?:once|to (?:the|his|her) (?:left|right)|left|right)\W*$|\W*$)"
)
"""Words of a single step."""
_ALONG_LEDGE = re.compile(
    r"\b(?:shimm|inch|sidl|edg(?:e|es|ing) )\w*|\balong (?:\w+ ){0,3}(?:ledge|cliff|edge|sill|parapet)\b"
)
"""Words of careful steps where there is little room."""
_STEPS = re.compile(
    r"\b(?:keeps?|repeatedly|again and again|over and over|continu\w*|around|steps of|many|several|few)\b"
)
_WAY = r"(?P<{0}>forwards?|ahead|front|back(?:wards?)?|rear)"
_SIDE = r"(?P<{0}>left|right)"
_DIAGONAL = re.compile(
    r"\bdiagonal\w*\b|\bat (?:a |an )?45[ -]degrees?\b"
    rf"|\b{_WAY.format('way')}[ -]{_SIDE.format('side')}\b(?! (?:foot|leg|hand|arm|knee|turn|side))"
    rf"|\b{_SIDE.format('first')}[ -]{_WAY.format('second')}\b"
)
"""Words of a way between ahead and a side: "diagonally to the left", "forward-right"."""
_BACK = re.compile(r"\bback(?:wards?)?\b|\brear\b")
_OTHER_WAY = re.compile(r"\b(?:run|ran|jog|sprint|sneak|creep|crawl|jump|leap|hop|turn|spin|danc|zig|weav)\w*\b")
"""Words of ways that are no steps."""
DIAGONAL = 45.0
"""Degrees of it ahead of the side."""
_THINGS = frozenset({"step", "steps", "sidestep", "sidesteps", "pace", "paces", "stride", "strides"})


def steps_aside(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the steps to a side that a prompt asks for; None if it names no number, pace or length of them."""
    text, pace = wish.prompt.lower(), stated_pace(wish.prompt)
    if _TO_AND_FRO.search(text):
        return None
    if not pace and _ALONG_LEDGE.search(text):
        pace = "slow"
    ahead = _ahead(text)
    count = stated_count(wish.prompt, "sidestep") or stated_things(text, _THINGS)
    if count is None and not wish.fixed and _ONE.search(text) and not _STEPS.search(text):
        count = 1
    metres = stated_distance(wish.prompt, "sidestep") if not wish.fixed else None
    if not (count or pace or metres or ahead or wish.fixed):
        return None
    side = wish.side or rng.choice(SIDES)
    lasts = seconds or rng.uniform(2.6, 3.6)
    return sidestep(rng, side, count=count, pace=pace, seconds=lasts, metres=metres, ahead=ahead)


def diagonal_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the steps between ahead or back and a side that a prompt of a walk asks for; None if it asks for others,
    or names no side."""
    side = _diagonal_side(wish.prompt.lower())
    return steps_aside(replace(wish, side=side), rng, seconds) if side else None


def goes_diagonally(prompt: str) -> bool:
    """Return True if a prompt asks for steps between ahead or back and a side: no rule of an action is for them."""
    return bool(_diagonal_side(prompt.lower()))


def _diagonal_side(text: str) -> str:
    """Return the side of a way of steps between it and ahead or back; empty if a text asks for another way."""
    named = set(re.findall(r"\b(left|right)(?:wards?)?\b", text))
    if len(named) != 1 or not _DIAGONAL.search(text) or _OTHER_WAY.search(text) or _TO_AND_FRO.search(text):
        return ""
    return named.pop()


def _ahead(text: str) -> float:
    """Return the degrees by which steps go ahead of the side, less than 0: behind it; 0 if they go straight there."""
    if not _DIAGONAL.search(text):
        return 0.0
    return -DIAGONAL if _BACK.search(text) else DIAGONAL
