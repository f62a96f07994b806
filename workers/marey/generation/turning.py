"""Turns on the spot and spins as their prompts ask for: as far, to the side, as often and at the pace that is named."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.pivots import pirouette
from marey.drawing.turns import turn_on_spot
from marey.generation.fine_wish import FineWish
from marey.posing.standing import LEFT, RIGHT, SIGN
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.paces import stated_pace
from marey.vocabulary.turns import WHOLE, stated_spins, stated_turn, turns_in_place

MOST_SPINS = 14
"""Whole turns at most."""
MOST_STEPPED = 3
"""Whole turns by small steps at most; more are made on one foot."""
MORE_SPINS = 2, 3
"""Whole turns of who is said to spin on and on."""
ON_FOOT = 0.35
"""Share of the single spins that are made on one foot, where the prompt does not say."""
USUAL: Mapping[str, tuple[float, ...]] = {"turn": (90.0,), "turn-around": (90.0, 180.0)}
"""Degrees of a turn of which the prompt says nothing."""
COMES_TO_REST_S = 0.34, 0.4
"""Seconds behind the last step in which the hips come to where the feet are."""
STANDS_S = 1.0, 1.3
"""Seconds that a body stands before it moves, where the prompt says that it stands first."""
_ROUNDED = 30.0
"""Degrees of which a turn of stated extent is a multiple."""
_STANDS_FIRST = re.compile(r"\b(?:stand\w*|waits?|waiting)\b[^.;]*(?:\bthen\b|\bbefore\b|\band\b|,)")
_RUNS = re.compile(r"\b(?:run|sprint|dash|rac|charg|bolt|flee)(?:s|es|e|ing|ning)?\b")
"""Words of what a quick turn goes before."""
_CLOCKWISE = re.compile(r"\b(?:(counter|anti)[ -]?)?clockwise\b")
_NAMED = re.compile(r"\b(left|right)\b(?![ -](?:foot|feet|leg|heel|toes?|hand|arm|fist|knee|shoulder|away|there)\b)")
_WHILE_GOING = re.compile(
    r"\b(?:while|as (?:he|she|they|it)|during|without stopping)\b[^,.;]*\b(?:walk|run|jog|march)\w*"
)
"""Words of turns around that are no turns on the spot."""
_ON_ONE_FOOT = re.compile(
    r"\b(?:pirouett\w*|ballet\w*|ballerina\w*|skat\w*|on (?:the )?(?:tip ?)?toes?|fouett\w*|axel"
    r"|(?:one|a single|his|her|the (?:left|right)) (?:foot|leg|toes?|heel))\b"
)
_STANDING_FOOT = re.compile(
    r"\bon (?:(?:the|his|her|their) )?(?:(?:ball|toes?|tip) of (?:the|his|her|their) )?"
    r"(left|right) (?:foot|leg|toes?|heel)\b"
)
"""Words of the foot on which a body spins, whichever way round it goes."""
_BALLET = re.compile(r"\b(?:pirouett\w*|ballet\w*|ballerina\w*|fouett\w*|danc\w*)\b")
_ON_AND_ON = re.compile(
    r"\b(?:around and (?:a)?round|round and round|circles|repeatedly|again and again|several|many|multiple|few|keeps"
    r"|continu\w*|over and over|dizz\w*|endless\w*|non-?stop|times|spins (?:and|&) spins)\b"
)


def turn_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the turn on the spot that a prompt asks for; None if the body turns on its way."""
    del seconds  # the body stands at the end
    return None if _WHILE_GOING.search(wish.prompt.lower()) else _turn(wish, rng, "turn-around")


def turn_in_place(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the turn of a prompt that speaks of no way; None if the body goes somewhere as it turns."""
    del seconds
    if not turns_in_place(wish.prompt):
        return None
    return _turn(wish, rng, "turn")


def _turn(wish: FineWish, rng: random.Random, action: str) -> Gesture:
    degrees = _degrees(without_gaze(wish.prompt), action, rng)
    pace = stated_pace(wish.prompt) or ("fast" if _RUNS.search(wish.beside[1].lower()) else "")
    return turn_on_spot(rng, SIGN[turned_side(wish, rng)] * degrees, pace=pace, waits=waits_of(wish, rng))


def _degrees(prompt: str, action: str, rng: random.Random) -> float:
    """Return the degrees, more than 0, by which a body turns."""
    turn = stated_turn(prompt, "turn-around")
    if turn is not None and turn.is_exact:
        return turn.least
    usual = stated_turn("", "turn-around")
    if turn is None or turn == usual:
        return rng.choice(USUAL[action])
    return max(round((turn.least + turn.most) / 2 / _ROUNDED), 1) * _ROUNDED


def turned_side(wish: FineWish, rng: random.Random) -> str:
    """Return the side to which a body turns: that of the words, else either."""
    text = without_gaze(wish.prompt).lower()
    clock = _CLOCKWISE.search(text)
    if clock is not None:
        return LEFT if clock[1] else RIGHT
    named = set(_NAMED.findall(text))
    return wish.side or (named.pop() if len(named) == 1 else rng.choice(SIDES))


def waits_of(wish: FineWish, rng: random.Random) -> tuple[float, float]:
    """Return seconds that a body stands before and after a movement: beside others those in which the hips come over
    the feet."""
    before, after = wish.beside
    first = STANDS_S if _STANDS_FIRST.search(wish.prompt.lower()) else (0.3, 0.45)
    return (
        rng.uniform(0.1, 0.15) if before else rng.uniform(*first),
        rng.uniform(*COMES_TO_REST_S) if after else rng.uniform(0.5, 0.7),
    )


def spin_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return as many whole turns as a prompt asks for, on small steps or on one foot; None if a body spins on its
    way."""
    del seconds
    text, pace, waits = wish.prompt.lower(), stated_pace(wish.prompt), waits_of(wish, rng)
    side, angle = turned_side(wish, rng), stated_turn(wish.prompt, "turn-around")
    turns = wish.count or stated_spins(wish.prompt)
    if turns is None and angle is not None and angle.is_exact and angle.least < WHOLE:
        return turn_on_spot(rng, SIGN[side] * angle.least, pace=pace or "fast", waits=waits)
    on_and_on = not any(wish.beside) and _ON_AND_ON.search(text)
    turns = min(turns or (rng.choice(MORE_SPINS) if on_and_on else 1), MOST_SPINS)
    foot = _STANDING_FOOT.search(text)
    one_foot = foot is not None or _ON_ONE_FOOT.search(text) is not None
    if one_foot or turns > MOST_STEPPED or (turns == 1 and rng.random() < ON_FOOT):
        arms = rng.choice(("round", "up")) if _BALLET.search(text) else "in" if not one_foot else ""
        stated = _CLOCKWISE.search(text) or _NAMED.search(text)
        side = side if stated or not foot else foot[1]
        return pirouette(rng, side, turns, arms=arms, pace=pace, waits=waits, foot=foot[1] if foot else "")
    return turn_on_spot(rng, SIGN[side] * WHOLE * turns, pace=pace, spins=True, waits=waits)
