"""Marches ahead and back: by number, by seconds, in step and in the style that the words name."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.marches import march, steps_in
from marey.generation.fine_wish import FineWish
from marey.generation.turning import waits_of
from marey.vocabulary.paces import stated_pace

USUAL_STEPS, BESIDE = (7, 9), (5, 6)
"""Steps of which no number is stated, alone and beside other movements."""
MOST_STEPS = 20
HALTS_S = 0.25
"""Seconds more that who halts stands before another movement, so that its transition keeps the last step."""
_MARCHES = re.compile(
    r"\b(?<!\bin )(?<!\blast )(?<!\bnext )march(?:es|ed|ing)?\b(?! \d)|\bgoose[- ]?step(?:s|ped|ping)?\b"
)
_KNEES = re.compile(r"\bknees?\b|\bhigh[- ](?:step|march|leg)\w*\b|\bmajorettes?\b")
_GOOSE = re.compile(r"\bgoose\b|\bparades?\b|\b(?:straight|stiff|stretched)[- ](?:legs?|legged|knees?)\b")
_OTHERS = re.compile(
    r"\b(?:in place|on the spot|in position|on place|without moving|treadmill|mark(?:s|ing)? time|stationary"
    r"|circles?|curv\w*|zig\w*|around|round|up|down|stairs?|hill|slope|back and forth|to and fro|sideways|diagonal\w*"
    r"|turns?|turning|left(?! (?:foot|leg))|right(?! (?:foot|leg))|drunk\w*|limp\w*|crouch\w*|stomp\w*|tip ?toe\w*)\b"
    r"|\bbackwards? and forwards?\b"
)
"""Words of marches on the spot and on other ways than straight ahead."""
_SWINGING = re.compile(
    r"\b(?:chin|head|hands?|arms?|flag|drum|knees?) (?:\w+ )?(?:up|down)\b|\bup and down\b(?= knees)"
)


def marches_straight(prompt: str) -> bool:
    """Return True if a prompt asks for a march on a straight way, which is drawn in its own style."""
    text = prompt.lower()
    return bool(_MARCHES.search(text)) and not _OTHERS.search(_SWINGING.sub(" ", text))


def march_asked_for(wish: FineWish, rng: random.Random, seconds: float | None, *, back: bool) -> Gesture | None:
    """Return the march that a prompt asks for; None for any other way.

    Args:
        wish: what the prompt asks for.
        rng: decides what the prompt does not say.
        seconds: that it has to fill; None = as many as it takes.
        back: it goes back.
    """
    if not marches_straight(wish.prompt):
        return None
    text, pace, waits = wish.prompt.lower(), stated_pace(wish.prompt), waits_of(wish, rng)
    waits = waits[0], waits[1] + HALTS_S * bool(wish.beside[1])
    style = "goose" if _GOOSE.search(text) else "knees" if _KNEES.search(text) else ""
    count = wish.count or (None if seconds is None else steps_in(seconds, pace, waits))
    count = count or rng.randint(*(BESIDE if any(wish.beside) else USUAL_STEPS))
    return march(rng, min(max(count, 2), MOST_STEPS), style=style, pace=pace, back=back, waits=waits)
