"""Steps to a side as their prompts ask for: by number, for some seconds, at a pace, or a single one."""

from __future__ import annotations

import random
import re

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
_STEPS = re.compile(
    r"\b(?:keeps?|repeatedly|again and again|over and over|continu\w*|around|steps of|many|several|few)\b"
)
_THINGS = frozenset({"step", "steps", "sidestep", "sidesteps", "pace", "paces", "stride", "strides"})


def steps_aside(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the steps to a side that a prompt asks for; None if it names no number, pace or length of them."""
    text, pace = wish.prompt.lower(), stated_pace(wish.prompt)
    if _TO_AND_FRO.search(text):
        return None
    count = stated_count(wish.prompt, "sidestep") or stated_things(text, _THINGS)
    if count is None and not wish.fixed and _ONE.search(text) and not _STEPS.search(text):
        count = 1
    metres = stated_distance(wish.prompt, "sidestep") if not wish.fixed else None
    if not (count or pace or metres or wish.fixed):
        return None
    side = wish.side or rng.choice(SIDES)
    return sidestep(rng, side, count=count, pace=pace, seconds=seconds or rng.uniform(2.6, 3.6), metres=metres)
