"""Loads for two hands that a prompt has a body lift or put down."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.loads import lift, put_down
from marey.generation.fine_wish import FineWish
from marey.vocabulary.loads import lifts_load, puts_load

_TABLES = re.compile(
    r"\b(?:tables?|desks?|counters?|workbench|bench|truck|trunk|cart|trolley|conveyor|car|van|chair|bed|sofa|platform)\b"
)
_SHELVES = re.compile(r"\b(?:shelf|shelves|rack|cupboard|cabinet)\b")
WALKS = "walks"
"""A movement in which a load may be held."""
_HEAVY = re.compile(r"\b(?:heav\w+|huge|struggl\w+|big|large|slowly|boulders?|barrels?)\b")
_DROPS = re.compile(r"\bdrop(?:s|ping)?\b")


def stated_load(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the lift or the put-down of a load for two hands; None if the prompt asks for neither."""
    del seconds
    text, before = wish.prompt.lower(), wish.beside[0].lower()
    if puts_load(text, before):
        where = text if _TABLES.search(text) or _SHELVES.search(text) else f"{text} {before}"
        onto = "shelf" if _SHELVES.search(where) else "table" if _TABLES.search(where) else "floor"
        on_floor = re.search(r"\b(?:floor|ground)\b", text)
        return put_down(rng, "floor" if on_floor else onto, drops=bool(_DROPS.search(text)))
    return lift(rng, heavy=bool(_HEAVY.search(text))) if lifts_load(text) else None
