"""Runs backward as their prompts ask for: for some seconds, so far, or by number, at a pace.

Networks know walks back; of "jogs backwards" they make one.
"""

from __future__ import annotations

import random
import re

from marey.drawing.back_runs import BACK_RUNS, back_steps_in, run_back
from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish
from marey.generation.turning import waits_of
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.paces import stated_pace

USUAL, BESIDE, MOST = (9, 12), (6, 8), 34
"""Steps of which no number is stated, alone and beside other movements, and at most."""
SHORT_S = 0.2
"""Seconds before and after a run of a length that is fixed, at most."""
_JOGS = re.compile(r"\b(?:jog|trot)\w*\b")
_RUNS = re.compile(r"\b(?:run|runs|running|ran|sprint\w*|dash\w*|rac(?:e|es|ing)|bolt\w*|rush\w*)\b")
_OTHERS = re.compile(
    r"\b(?:turn|circl|curv|zig|diagonal|sneak|creep|stagger|stumbl|limp|hop|jump|danc|crouch|weav|treadmill|in place"
    r"|on the spot|back and forth|to and fro|up and down|stair|left(?! (?:foot|leg))|right(?! (?:foot|leg)))\w*\b"
)
"""Words of ways that are no plain runs back."""


def runs_back(prompt: str) -> str:
    """Return the name in `BACK_RUNS` of the plain run that a prompt of a way back asks for; empty for others."""
    text = prompt.lower()
    if _OTHERS.search(text):
        return ""
    return "jog" if _JOGS.search(text) else "run" if _RUNS.search(text) else ""


def run_back_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the run backward that a prompt asks for; None for any other way back.

    Args:
        wish: what the prompt asks for.
        rng: decides what the prompt does not say.
        seconds: that it has to fill; None = as many as it takes.
    """
    form = runs_back(wish.prompt)
    if not form:
        return None
    pace, waits = stated_pace(wish.prompt), waits_of(wish, rng)
    waits = (min(waits[0], SHORT_S), min(waits[1], SHORT_S)) if wish.fixed else waits
    count = wish.count or (None if seconds is None else back_steps_in(seconds, form, pace, waits))
    metres = stated_distance(wish.prompt, "walk-backward") if count is None and not wish.fixed else None
    if metres is not None:
        count = round(metres / BACK_RUNS[form].metres) + 1
    count = count or rng.randint(*(BESIDE if any(wish.beside) else USUAL))
    return run_back(rng, min(max(count, 3), MOST), form=form, pace=pace, waits=waits)
