"""Ways up and down stairs as their prompts ask for: over as many stairs and at the pace that is named."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.stairs import Flight, walk_stairs
from marey.generation.fine_wish import FineWish
from marey.generation.turning import waits_of
from marey.vocabulary.counts import stated_things
from marey.vocabulary.paces import Pace, stated_pace

MOST_STAIRS = 14
"""Stairs at most."""
SOME, SOME_BESIDE = (4, 6), (4, 4)
"""Stairs of which the prompt names no number, alone and beside other movements."""
STAIR_S = 0.6
"""Seconds of a stair, for a length that is fixed."""
_STAIRS = frozenset({"stair", "stairs", "step", "steps", "tread", "treads", "stairsteps"})
_AT_A_TIME = re.compile(r"\b\w+ (?:\w+ )?at (?:a|one) time\b")
_DOWN = re.compile(r"\b(?:down|downwards?|downstairs|descend\w*|descent)\b")
_UP = re.compile(r"\b(?:up|upwards?|upstairs|ascend\w*|ascent)\b")
_OTHERS = re.compile(r"\b(?:crawl|slid|fall|fell|tumbl|trip|jump|hop|leap|roll|backward|backwards|sideways)\w*\b")
"""Words of ways over stairs that are no steps ahead."""
_RUNS = re.compile(r"\b(?:run|ran|sprint|dash|rush|rac|hurr|bound|jog|charg)\w*\b")
_HEAVY = re.compile(
    r"\b(?:old|elderly|tired|exhausted|weary|careful\w*|cautious\w*|heav\w*|sneak\w*|tip ?toe\w*|trudg\w*)\b"
)


def stairs_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the way over stairs that a prompt asks for; None if it is not made by steps ahead."""
    text = wish.prompt.lower()
    if _OTHERS.search(text):
        return None
    waits = waits_of(wish, rng)
    number = stated_things(_AT_A_TIME.sub(" ", text), _STAIRS)
    if number is None and seconds is not None:
        number = max(2, round((seconds - sum(waits)) / STAIR_S) - 1)
    if number is None:
        number = rng.randint(*(SOME_BESIDE if any(wish.beside) else SOME))
    down = bool(_DOWN.search(text)) and not _UP.search(text)
    return walk_stairs(rng, Flight(min(number, MOST_STAIRS), down, _pace(text)), waits)


def _pace(text: str) -> Pace:
    """Return the pace of a way over stairs, of the body if no other is named."""
    return stated_pace(text) or ("fast" if _RUNS.search(text) else "slow" if _HEAVY.search(text) else "")
