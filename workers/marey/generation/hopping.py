"""Hops and jumps back, to a side or down: most are dodges in the vocabulary, of which networks know the crouch."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.hops import hop_away, jump_aside, jumps
from marey.drawing.stunts import jump_down
from marey.generation.fine_wish import FineWish
from marey.posing.standing import SIGN
from marey.vocabulary.counts import stated_count
from marey.vocabulary.drops import lands_low, stated_drop

_WAY = re.compile(
    r"\b(?P<verb>hop|jump|leap|spring|bound)\w*(?: (?:\w+ly|once|twice|\w+ times|straight|far|a (?:step|little|bit)))*"
    r" (?:side(?:ways|wise) (?=to |left|right))?"
    r"(?:(?P<back>back(?:wards?)?)|(?:to (?:the|his|her|their) )?(?P<side>left|right|side(?:ways|wise)?|aside))\b"
    r"(?! (?:and forth|and right|and left|to side|up|down|on(?! (?:one|the|his|her|their) (?:left |right )?"
    r"(?:leg|foot))|onto|into|over(?<!backward over)(?<!backwards over)|to (?:his|her|their) (?:feet|seat)))"
)
"""Words of a jump back or to a side."""
_AHEAD = re.compile(r"\b(?:forwards?|ahead|across|along|onwards?|over to|to the (?:door|wall|window|other side))\b")
"""Words of hops ahead."""
_BACKWARD_HOPS = re.compile(r"\bback(?:wards?)? (?:\w+ )?(?:hop|jump)\w*\b")
_DOWN_M = {"high": (1.5, 1.75), "low": (0.45, 0.65), "": (0.95, 1.25)}
"""Metres that a body drops, by how high it stands."""
_ON_SPOT = re.compile(r"\b(?:jump|leap|spring)(?:s|ing)?(?: (?:up|high|straight|once))*(?=,| and\b| then\b| land)")
_ONE_LEG = re.compile(r"\bone (?:leg|foot)\b|\b(?:left|right) (?:leg|foot)\b")
_FAR = re.compile(r"\b(?:far|big|long|great)\b")
_FLIGHT_S = {"hop": (0.3, 0.36)}
_BACK_M, _ASIDE_M = {"hop": (0.35, 0.5)}, (0.25, 0.36)
_JUMP_S, _JUMP_BACK_M, _JUMP_ASIDE_M = (0.36, 0.44), (0.5, 0.68), (0.45, 0.6)
"""Seconds of a flight, and metres of one, of hops and of all others."""
_AHEAD_M = 0.34, 0.48
"""Metres of a hop ahead on one foot."""
MOST, SOME = 12, (3, 5)
"""Jumps that are drawn at most, and hops ahead of which no number is stated."""
_FARTHER = 1.35


def jumps_away(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the jump of both feet that a prompt asks for, back, to a side or down, once if no number is stated; None
    if it asks for none."""
    del seconds  # the body stands before and after
    text = wish.prompt.lower()
    low = lands_low(text)
    if drop := stated_drop(text):
        return jump_down(rng, rng.uniform(*_DOWN_M[drop.high]), heavy=drop.heavy, low=low)
    found = _WAY.search(text)
    if _ONE_LEG.search(text) or (found is None and not (low and _ON_SPOT.search(text))):
        return None
    if found is None:
        return jumps(rng, ["jump"], rng.uniform(0.3, 0.6), rng.uniform(*_JUMP_S), _times(wish), low=True)
    verb, times = found["verb"], _times(wish)
    flight = rng.uniform(*_FLIGHT_S.get(verb, _JUMP_S))
    farther = _FARTHER if _FAR.search(text) else 1.0
    if found["back"]:
        metres = farther * rng.uniform(*_BACK_M.get(verb, _JUMP_BACK_M))
        return jumps(rng, ["jump-back"], rng.uniform(0.55, 0.8), flight, times, ahead=-metres, quick=True, low=low)
    return jump_aside(rng, flight, times, _sign(found["side"], rng) * farther * rng.uniform(*_JUMP_ASIDE_M), low=low)


def hops_away(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the hops on one foot that a prompt asks for, ahead, back or to a side, once back or aside if no number is
    stated; None if it asks for none."""
    del seconds
    text = wish.prompt.lower()
    found = _WAY.search(text)
    if found is None:
        if _ONE_LEG.search(text) and _BACKWARD_HOPS.search(text):
            return hop_away(rng, _times(wish), 0.0, -rng.uniform(*_ASIDE_M), wish.side)
        if not (_AHEAD.search(text) and _ONE_LEG.search(text)):
            return None
        return hop_away(rng, _times(wish, rng.randint(*SOME)), 0.0, rng.uniform(*_AHEAD_M), wish.side)
    metres = rng.uniform(*_ASIDE_M)
    if found["back"]:
        return hop_away(rng, _times(wish), 0.0, -metres, wish.side)
    return hop_away(rng, _times(wish), _sign(found["side"], rng) * metres, 0.0, wish.side)


def _sign(side: str, rng: random.Random) -> float:
    """Return 1 for the left and -1 for the right, either by chance where the words leave it open."""
    return SIGN[side if side in SIDES else rng.choice(SIDES)]


def _times(wish: FineWish, usual: int = 1) -> int:
    """Return how many jumps are asked for, or that are usual."""
    return min(wish.count or stated_count(wish.prompt, "jump") or stated_count(wish.prompt, "hop") or usual, MOST)
