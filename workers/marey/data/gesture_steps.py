"""Steps of a captured idle on the spot and to the side: turns on the spot, spins on small steps, sidesteps."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from marey.data.part import FPS
from marey.drawing.footsteps import Footstep, Manner, stepped
from marey.drawing.gesture import SIDES, Gesture
from marey.posing.standing import ARMS, LEFT, StandingBody, eased

_TURN_PACES = {"quick": (0.26, 0.34), "": (0.36, 0.52), "slow": (0.6, 0.85)}  # seconds from one step to the next
_UNTRUE = {
    "around-half": r"\b90\b|quarter",
    "around-quarter": r"180|about.?face|about turn|other way|behind|back|half|u-turn",
    "around-more": r"180|90|about.?face|about turn|other way|half|quarter|u-turn",
}
"""Patterns of words that are true of other turns on the spot."""
_SIDE_PACES = {"quick": (0.24, 0.32), "": (0.36, 0.5), "slow": (0.58, 0.8)}
_LENGTHS = {"quick": (0.28, 0.5), "": (0.2, 0.42), "slow": (0.2, 0.4)}  # metres of a sidestep
_SWING = 0.92  # of the time to the next step
_LARGEST_PART = 95.0  # degrees that a foot turns in one step


def turn_around(rng: random.Random) -> Gesture:
    side = rng.choice(SIDES)
    form, limits = rng.choices(
        (("around-half", (165, 195)), ("around-quarter", (75, 105)), ("around-more", (105, 165))), (5, 3, 2)
    )[0]
    pace = rng.choices(list(_TURN_PACES), (1, 3, 1))[0]
    steps, end = _turning(rng, side, rng.uniform(*limits), rng.uniform(*_TURN_PACES[pace]))
    kinds = ("around", form, *([f"around-{pace}"] if pace else []))
    return replace(_stepping(rng, steps, end, kinds, side), untrue=_UNTRUE[form])


def small_step_spin(rng: random.Random) -> Gesture:
    """A spin on small steps, 300 degrees or more in one go."""
    side, turns = rng.choice(SIDES), rng.choice((1, 1, 1, 2))
    steps, end = _turning(rng, side, 360.0 * turns, rng.uniform(0.2, 0.27))
    made = _stepping(rng, steps, end, ("spin", "spin-steps", "spin-twice" if turns == 2 else "spin-once"), side)
    return replace(made, untrue="pirouette")


def _turning(rng: random.Random, side: str, degrees: float, interval: float) -> tuple[list[Footstep], float]:
    """Steps of a turn and their end in seconds: the inner foot opens, the outer one closes."""
    sign, inner = (1.0, 0) if side == LEFT else (-1.0, 1)
    pairs = -(-int(degrees) // int(rng.uniform(0.75, 1.0) * _LARGEST_PART))
    closer = rng.uniform(0.0, 0.2)
    start, steps = rng.uniform(0.2, 1.0), list[Footstep]()
    for pair in range(1, pairs + 1):
        for foot in (inner, 1 - inner):
            past = 0.0 if foot == inner or pair == pairs else closer
            steps.append(
                Footstep(foot, start, _SWING * interval, degrees=sign * min((pair + past) * degrees / pairs, degrees))
            )
            start += interval
    return steps, start


def sidestep(rng: random.Random) -> Gesture:
    side = rng.choice(SIDES)
    pace = rng.choices(list(_SIDE_PACES), (1, 3, 1))[0]
    low = rng.random() < 0.25
    goes_on = rng.random() < 0.4  # steps from the first frame to the last
    interval, length = rng.uniform(*_SIDE_PACES[pace]), rng.uniform(*_LENGTHS[pace])
    pairs = max(rng.randint(2, 7), 1 + int(0.6 / length)) + goes_on
    sign, lead = (1.0, 0) if side == LEFT else (-1.0, 1)
    start, steps = -rng.uniform(0.2, 1.0) * interval if goes_on else rng.uniform(0.15, 0.9), list[Footstep]()
    for pair in range(1, pairs + 1):
        for foot in (lead, 1 - lead):
            steps.append(Footstep(foot, start, _SWING * interval, left=sign * pair * length))
            start += interval
    kinds = ("sidestep", *([f"sidestep-{pace}"] if pace else []), *(["sidestep-low"] if low else []))
    made = _stepping(rng, steps, start, kinds, side, low=rng.uniform(0.08, 0.16) if low else 0.0)
    return replace(made, seconds=start - rng.uniform(0.5, 1.0) * interval) if goes_on else made


def _stepping(
    rng: random.Random, steps: Sequence[Footstep], end: float, kinds: tuple[str, ...], side: str, *, low: float = 0.0
) -> Gesture:
    """Steps of an idle, with the hands before the body and the hips `low` metres lower in a guarded one."""
    manner, stoop, shrug = Manner.draw(rng), rng.uniform(-3, 4), rng.uniform(-1, 6)
    point = np.array([rng.uniform(0.05, 0.15), rng.uniform(-0.28, -0.1), rng.uniform(0.26, 0.36)])

    def change(body: StandingBody) -> None:
        t = np.arange(len(body.joints)) / FPS
        moving = eased((t - steps[0].start + 0.25) / 0.4) * (1 - eased((t - end - 0.1) / 0.5))
        body.lean(stoop * moving, "left")
        for one, sign in zip(SIDES, (1.0, -1.0), strict=True):
            body.turn(ARMS[one][1], "forward", -sign * shrug * moving)
        if low:
            body.shift(-low * moving, -0.3 * low * moving)
            body.lean(18.0 * moving, "left")
            for one in SIDES:
                body.hold(one, moving, point)
        body.joints[:] = stepped(body.joints, steps, manner)

    return Gesture(end + rng.uniform(0.3, 1.2), kinds, change, side)
