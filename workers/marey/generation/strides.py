"""A few strides by number: "takes three steps forward"."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.strides import strides
from marey.generation.fine_wish import FineWish
from marey.generation.turning import waits_of
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.paces import stated_pace

FEWEST, MOST_STRIDES = 2, 6
"""Strides that are drawn; one alone, and ways of more of them, are a network's."""
AHEAD_M, BACK_M = 0.6, 0.47
"""Metres of a stride ahead and of one back, about."""
_OTHERS = re.compile(
    r"\b(?:turn|run|ran|jog|sprint|sneak|creep|tip ?-?toe|stagger|stumbl|limp|hop|jump|leap|danc|crouch|circl|curv"
    r"|tiny|huge|baby|sideways|side|left|right|diagonal|zig|drunk|march|goose|lunge|crawl|shuffl|skip|stomp|giant)\w*\b"
)
"""Words of ways that are no plain strides ahead or back."""


def strides_asked_for(wish: FineWish, rng: random.Random, *, back: bool) -> Gesture | None:
    """Return the few strides that a prompt asks for by number; None for any other way.

    Args:
        wish: what the prompt asks for.
        rng: decides what the prompt does not say.
        back: they go back.
    """
    text, count = wish.prompt.lower(), wish.count or 0
    metres = stated_distance(text, "walk-backward" if back else "walk") if not count and not wish.fixed else None
    if metres is not None:
        count = max(round(metres / (BACK_M if back else AHEAD_M)) + 1, FEWEST)
    gaits = any(each.bearing.gait for each in stated_bearings(wish.prompt))
    if not FEWEST <= count <= MOST_STRIDES or gaits or _OTHERS.search(text):
        return None
    return strides(rng, count, back=back, pace=stated_pace(wish.prompt), waits=waits_of(wish, rng), metres=metres)
