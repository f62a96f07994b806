"""Kicks as their prompts ask for: round, high, with a spin, and those of a ball out of a run-up."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.kicks import high_kick, spin_kick
from marey.drawing.struck_kicks import ball_strike, roundhouse
from marey.generation.fine_wish import FineWish

MOST = 6
"""Round kicks at most."""
HIGH_M, LOW_M = (1.38, 1.46), (0.5, 0.6)
"""Metres of the foot over the floor in a round kick that is called high or low."""
_SPINS = re.compile(r"\b(?:spin\w*|spun|tornado|turning|360|whirl\w*|wheel[ -]kick|back[ -]?hook)\b")
_HIGH_KICK = re.compile(
    r"\bhigh[ -]kick\w*|\bhigh (?:\w+ )?kicks?\b|\bkick(?:s|ing|ed)? (?:(?!low|not)\w+ ){0,4}?high\b(?! (?:up )?in)"
    r"|\bkick\w* .*\b(?:head|face|eye|shoulder)[ -](?:high|height|level)\b"
    r"|\bkick\w* .*\b(?:over|above) (?:his|her|their) head\b"
)
_NO_FRONT_KICK = re.compile(r"\b(?:ball|football|round\w*|side|crescent|axe|back|bicycle|knees?|can|stone|door)\b")
_ROUND = re.compile(r"\bround[ -]?(?:house)?[ -]?kick\w*|\broundhouse\w*")
_UP = re.compile(r"\b(?:high|higher|head|face|jaw|chin|temple|neck|ear)\b")
_DOWN = re.compile(r"\b(?:low|shin|shins|thigh|thighs|calf|knees?|legs? kick)\b")
_HARD = re.compile(
    r"\b(?:penalt(?:y|ies)|(?:free|goal|place)[ -]?kicks?|corner(?:[ -]kick)?s?|field goals?|punts?|volley\w*"
    r"|(?:long|far|hard|powerful|forceful|mighty) (?:\w+ )?(?:balls?|kicks?|shots?|pass)|conversion|hard|harder"
    r"|powerful\w*|forceful\w*|full (?:force|power)|shoots?|shooting|blasts?|boots?|booting|hammers?|smash\w*"
    r"|far|as far as|run[- ]?up|running start|approach\w*|into the (?:net|goal)|on goal|at (?:the )?goal|top corner)\b"
    r"|\b(?:two|three|few|couple of|short|quick|running) (?:\w+ )?steps?\b"
    r"|\b(?:runs?|sprints?) (?:up|in|at|to|towards?)\b"
)
_SOFT = re.compile(
    r"\b(?:soft\w*|gent\w*|light\w*|pass(?:es)?|taps?|little|slow\w*|nudg\w*|juggl\w*|not (?:\w+ )?hard)\b"
)
"""Words of a kick of a ball with a run-up, and of one that needs none."""
_NUMBER = re.compile(r"\b(two|three|2|3) (?:\w+ )?steps?\b")


def _up(text: str, rng: random.Random) -> float:
    """Return the metres of the foot in a round kick; 0 = those of any."""
    limits = HIGH_M if _UP.search(text) else LOW_M if _DOWN.search(text) else None
    return rng.uniform(*limits) if limits else 0.0


def kick_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the kick whose form a prompt states: round, high or with a spin; None if it states none."""
    del seconds
    text = wish.prompt.lower()
    if _ROUND.search(text) and not _SPINS.search(text) and (wish.count or 1) <= MOST:
        return roundhouse(rng, wish.side, _up(text, rng), wish.count or 1)
    if (wish.count or 1) != 1:
        return None
    if _SPINS.search(text):
        return spin_kick(rng, wish.side)
    return high_kick(rng, wish.side) if _HIGH_KICK.search(text) and not _NO_FRONT_KICK.search(text) else None


def ball_kick_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the kick of a ball out of a run-up; None if a prompt asks for a soft one, for several, or says nothing of
    it."""
    del seconds
    text = wish.prompt.lower()
    if (wish.count or 1) != 1 or _SOFT.search(text) or not _HARD.search(text):
        return None
    number = _NUMBER.search(text)
    return ball_strike(rng, wish.side, None if number is None else 2 if number[1] in ("two", "2") else 3)
