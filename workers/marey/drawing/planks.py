"""Planks: a straight body that holds itself on hands or forearms, also on one side."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

from marey.drawing.exercises import reach_of, straight_body
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture, mirrored
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT

_FEET = -0.9
"""Metres behind the place where a body stood of its ankles."""
_ON_HANDS, _ON_FOREARMS = 0.52, 0.325
"""Metres of the shoulders over the floor."""
_FOREARM, _STRETCH = 0.24, 0.012
_APART: dict[str, Point] = dict.fromkeys(SIDES, (0.35, 0.2, 1.0))
_KNEES_AHEAD: dict[str, Point] = dict.fromkeys(SIDES, (0.0, 0.0, 1.0))


def plank(
    rng: random.Random, form: str = "", side: str = "", *, seconds: float, enters: bool = False, leaves: bool = False
) -> Gesture:
    """A plank that is held.

    Args:
        rng: decides everything that is not given.
        form: `hands` for straight arms, `side` for one on the forearm of a side; empty = on both forearms.
        side: of the arm of a plank on one side.
        seconds: that it takes altogether.
        enters: it begins standing, and otherwise in the plank.
        leaves: it ends standing.
    """
    hold = seconds - 1.8 * enters - 1.7 * leaves
    high = _on_hands()
    held = _on_side() if form == "side" else high if form == "hands" else _on_forearms()
    if form == "side" and side == RIGHT:
        held = mirrored(held)
    between = () if form == "hands" else ((0.5 if form == "side" else 0.35, high),)
    done = Sequel([rng.uniform(0.1, 0.2)], [held])
    if enters:
        done = Sequel([rng.uniform(0.15, 0.3)])
        _goes(done, _down(high), between, held)
    _holds(rng, done, held, max(hold, 1.0))
    if leaves:
        for pause, posture in (*between, *_up(high)):
            done.then(pause, posture)
        done.then(0.5, STAND)
    told = ["plank", f"plank-{form}" if form else "plank-forearms"]
    gesture = done.gesture(rng, told, side if form == "side" else "")
    return replace(gesture, fills=not (enters or leaves), seconds=done.times[-1] + (0.3 if leaves else 0.1))


def _goes(
    done: Sequel, down: Sequence[tuple[float, Posture]], between: Sequence[tuple[float, Posture]], held: Posture
) -> None:
    for pause, posture in down:
        done.then(pause, posture)
    done.then(between[0][0] if between else 0.05, held)


def _holds(rng: random.Random, done: Sequel, held: Posture, seconds: float) -> None:
    """Stay, with the small rise and fall of a body that breathes and works."""
    ends = done.times[-1] + seconds
    sign = 1.0
    while done.times[-1] < ends - 0.6:
        left, up, ahead = held.pelvis or (0.0, 0.0, 0.0)
        moved = replace(held, pelvis=(left, up + sign * rng.uniform(0.002, 0.007), ahead + rng.uniform(-0.003, 0.003)))
        done.then(min(rng.uniform(0.7, 1.0), max(ends - done.times[-1], 0.3)), moved)
        sign = -sign
    done.then(max(ends - done.times[-1], 0.2), held)


def _on_hands() -> Posture:
    hand = HandPlace((0.2, 0.05, _FEET + reach_of(_ON_HANDS) + 0.02), "floor", (0.6, 0.3, -0.8))
    return _stretched(straight_body(_ON_HANDS, -14, _FEET, hand))


def _on_forearms() -> Posture:
    at = _FEET + reach_of(_ON_FOREARMS) + _FOREARM + 0.02
    hand = HandPlace((0.14, 0.045, at), "floor", (0.25, -1.0, -0.5))
    return _stretched(straight_body(_ON_FOREARMS, -10, _FEET, hand))


def _stretched(posture: Posture) -> Posture:
    """The posture with knees that are straight, not almost so."""
    feet = {side: replace(foot, at=(*foot.at[:2], foot.at[2] - _STRETCH)) for side, foot in posture.feet.items()}
    return replace(posture, feet=feet)


def _on_side() -> Posture:
    """On the left forearm and the left foot, the right foot on it and the right hand at the hip."""
    hips = -0.1
    feet = {
        LEFT: FootPlace((hips - 0.84, 0.07, -0.02), (-0.2, -0.2, 0.95)),
        RIGHT: FootPlace((-hips + 0.84, 0.15, 0.02), (0.2, -0.2, 0.95)),
    }
    hands = {
        LEFT: HandPlace((hips + 0.48, 0.045, _FOREARM), "floor", (0.1, -1.0, -0.6)),
        RIGHT: HandPlace((0.22, -0.42, 0.03), "trunk", (0.9, 0.0, -0.5)),
    }
    return Posture((hips, 0.3, 0.0), (0, -79, 0), (0, 4, 0), (0, -4, 0), 0.0, hands, feet, _KNEES_AHEAD)


def _crouched(hands: dict[str, HandPlace]) -> Posture:
    return Posture((0.0, 0.5, 0.0), (50, 0, 0), (46, 0, 0), (-20, 0, 0), 0.8, hands, knees=_APART)


def _stepping(high: Posture, crouch: Posture) -> Posture:
    """On the hands, with one foot back already."""
    feet = {LEFT: high.feet[LEFT]}
    return replace(crouch, pelvis=(0.0, 0.52, -0.2), tilt=(68, 0, 0), spine=(26, 0, 0), feet=feet)


def _down(high: Posture) -> tuple[tuple[float, Posture], ...]:
    """Ways from standing to a plank on the hands: one foot steps back after the other."""
    crouch = _crouched(both(high.hands[LEFT]))
    return (0.6, crouch), (0.4, _stepping(high, crouch)), (0.4, high)


def _up(high: Posture) -> tuple[tuple[float, Posture], ...]:
    crouch = _crouched(both(high.hands[LEFT]))
    return (0.35, high), (0.4, _stepping(high, crouch)), (0.4, crouch)
