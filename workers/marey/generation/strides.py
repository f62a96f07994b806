"""A few strides: by number ("takes three steps forward"), a single one ("steps back"), and ways back."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.strides import strides
from marey.generation.fine_wish import FineWish
from marey.generation.marching import march_asked_for
from marey.generation.turning import waits_of
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.counts import is_single_step
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.paces import stated_pace

MOST_STRIDES = 6
"""Strides ahead that are drawn; ways of more of them are a network's."""
AHEAD_M, BACK_M = 0.6, 0.47
"""Metres of a stride ahead and of one back, about."""
FEW, BACK, MOST_BACK = (3, 4), (5, 6), 14
"""Strides of "a few" and of a way back of which no number is stated, and of a way back at most."""
BACK_S = {"slow": 0.85, "": 0.56, "fast": 0.43}
"""Seconds of a stride back, by pace, for a length that is fixed."""
SOME_TINY, SOME_TINY_BESIDE, MOST_TINY = (9, 12), (6, 7), 30
"""Tiny steps of which no number is stated, alone and beside other movements, and at most."""
TINY_S = {"slow": 0.57, "": 0.45, "fast": 0.42}
"""Seconds of one, by pace, for a length that is fixed."""
TINY = {"": 0.48, "waddle": 0.44, "shuffle": 0.42}
"""Shares of the length of a stride."""
_WADDLES = re.compile(r"\b(?:waddl|toddl|toddler|bab(?:y|ies)|penguin|duck)\w*\b")
_DRAGS = re.compile(r"\b(?:shuffl\w*|drag(?:s|ging)? (?:his|her|their|the) (?:feet|heels))\b")
_TINY = re.compile(
    r"\b(?:tiny|small|baby|little|short|mincing|wee) (?:\w+ )?steps\b|\b(?:waddl|toddl)(?:es?|ing|ed)\b|\btoddlers?\b"
    r"|\bshuffl(?:es?|ing|ed)\b(?! (?:the |a |some |his |her )?(?:\w+ )?(?:cards?|deck|papers?|step))"
    r"|\bdrag(?:s|ging)? (?:his|her|their|the) (?:\w+ )?(?:feet|heels)\b"
)
"""Words of tiny steps, and of feet that are dragged."""
_OTHERS = re.compile(
    r"\b(?:turn|run|ran|jog|sprint|sneak|creep|tip ?-?toe|stagger|stumbl|limp|hop|jump|leap|danc|crouch|circl|curv"
    r"|tiny|huge|baby|sideways|side|left|right|diagonal|zig|drunk|march|goose|lunge|crawl|shuffl|skip|stomp|giant"
    r"|moonwalk|stair|upstairs|downstairs|hill|treadmill|in place|on the spot|back and forth|to and fro"
    r"|up and down)\w*\b"
)
"""Words of ways that are no plain strides ahead or back."""
_LIMB = re.compile(r"\b(?:with|on|lead\w*|using) (?:(?:the|his|her|their|your|my) )?(?:left|right) (?:foot|leg)\b")
_FEW = re.compile(r"\b(?:a few|some|several|a couple of) (?:\w+ )?(?:steps|paces|strides)\b")
_LONG = re.compile(r"\b(?:big|large|long|wide|great|huge|giant)\b")
_SMALL = re.compile(r"\b(?:small|little|tiny|short|half)\b")


def strides_asked_for(wish: FineWish, rng: random.Random, seconds: float | None, *, back: bool) -> Gesture | None:
    """Return the few strides that a prompt asks for, by number or by its words; None for any other way.

    Args:
        wish: what the prompt asks for.
        rng: decides what the prompt does not say.
        seconds: that they have to fill; None = as many as they take.
        back: they go back.
    """
    marched = march_asked_for(wish, rng, seconds, back=back)
    if marched is not None:
        return marched
    tiny = _tiny_steps(wish, rng, seconds, back=back)
    if tiny is not None:
        return tiny
    text, pace = _LIMB.sub(" ", wish.prompt.lower()), stated_pace(wish.prompt)
    if any(each.bearing.gait for each in stated_bearings(wish.prompt)) or _OTHERS.search(text):
        return None
    count, metres = _count(wish, text, rng), None
    if count is None and not wish.fixed:
        metres = stated_distance(text, "walk-backward" if back else "walk")
    if metres is not None:
        count = max(round(metres / (BACK_M if back else AHEAD_M)) + 1, 2)
    if count is None and back:
        room = None if seconds is None else round((seconds - 0.9) / BACK_S[pace])
        count = rng.randint(*BACK) if room is None else min(max(room, 2), MOST_BACK)
    if count is None or not 1 <= count <= (MOST_BACK if back else MOST_STRIDES):
        return None
    size = 1.2 if _LONG.search(text) else 0.7 if _SMALL.search(text) else 1.0
    return strides(rng, count, back=back, pace=pace, waits=waits_of(wish, rng), metres=metres, size=size)


def drags_feet(said: str) -> bool:
    """Return True if a prompt asks for dragged feet, which are drawn as they drag."""
    text = said.lower()
    return _is_tiny(text) and _DRAGS.search(text) is not None


def _is_tiny(text: str) -> bool:
    """Return True if a text in small letters asks for tiny or dragged steps ahead or back, and no other way."""
    return _TINY.search(text) is not None and _OTHERS.search(_TINY.sub(" ", text)) is None


def _tiny_steps(wish: FineWish, rng: random.Random, seconds: float | None, *, back: bool) -> Gesture | None:
    """Return the way of tiny steps that a prompt asks for, of a small child or with dragged feet; None for others."""
    text, pace = wish.prompt.lower(), stated_pace(wish.prompt)
    gaits = {each.bearing.gait for each in stated_bearings(wish.prompt)} - {""}
    if not _is_tiny(text) or gaits - {"shuffle"}:
        return None
    waits, form = waits_of(wish, rng), "waddle" if _WADDLES.search(text) else "shuffle" if _DRAGS.search(text) else ""
    room = None if seconds is None else round((seconds - sum(waits)) / TINY_S[pace])
    some = rng.randint(*(SOME_TINY_BESIDE if any(wish.beside) else SOME_TINY)) if room is None else room
    count = min(max(wish.count or some, 2), MOST_TINY)
    timed = {"slow": "tiny-slow", "": "tiny"}.get(pace, pace)
    return strides(rng, count, back=back, pace=timed, waits=waits, size=TINY[form], form=form)


def _count(wish: FineWish, text: str, rng: random.Random) -> int | None:
    """Return the number of strides that the words name; None = they name none."""
    if wish.count is not None:
        return wish.count
    if _FEW.search(text):
        return rng.randint(*FEW)
    return 1 if is_single_step(text) else None
