"""Bodies that crawl on hands and knees, or on the belly."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import OTHER_SIDE, SIGN

_PELVIS = 0.47
"""Metres of the hips over the floor: a thigh over a knee that lies on it."""
_SHANK = 0.4
_ANKLE, _FOOT = 0.075, (0.0, -0.45, -0.89)
"""Metres of an ankle over the floor, and where the foot behind it points: the toes lie on it, lower than the knees."""
_TILT = 83.0
"""Degrees by which the hips are tilted; the trunk is about level."""
_SHOULDERS = 0.47
"""Metres of the shoulders ahead of the hips."""
_PACES = {"slow": (1.5, 2.1), "": (0.95, 1.25), "quick": (0.72, 0.92)}
"""Seconds in which each limb moves once."""
_PostureAt = Callable[[float, dict[str, float], dict[str, float], str], Posture]
_LIFT = 0.07
"""Metres by which a hand is lifted on its way."""


def on_fours(rng: random.Random) -> Posture:
    """On hands and knees, about where a crawl ends."""
    hand = HandPlace((rng.uniform(0.15, 0.22), 0.05, _SHOULDERS + 0.04), "floor", (0.6, 0.2, -0.8))
    shank = FootPlace((rng.uniform(0.08, 0.13), _ANKLE, 0.02 - _SHANK), _FOOT)
    posture = Posture((0.0, _PELVIS, 0.0), (_TILT, 0, 0), (0, 0, 0), (rng.uniform(-36, -16), 0, 0))
    poles: Point = (0.1, -0.8, 0.6)
    return replace(
        posture, hands=dict.fromkeys(SIDES, hand), feet=dict.fromkeys(SIDES, shank), knees=dict.fromkeys(SIDES, poles)
    )


def crawl(
    rng: random.Random, *, back: bool | None = None, seconds: float | None = None, metres: float | None = None
) -> Gesture:
    """The hand of one side and the knee of the other move together, then the other two.

    Args:
        rng: decides everything that is not given.
        back: backward.
        seconds: for about how long.
        metres: how far; None = as far as it comes.
    """
    tempo = rng.choice(["slow", "", "", "quick"])
    period = rng.uniform(*_PACES[tempo])
    stride = rng.uniform(0.42, 0.52) if tempo != "slow" else rng.uniform(0.3, 0.42)
    back = rng.random() < 0.15 if back is None else back
    if back:
        stride = -0.7 * stride
    cycles = max(2, round(seconds / period) if seconds else min(round(rng.uniform(2.6, 7.4) / period), 8))
    cycles, stride = _over(metres, cycles, stride)
    wide, knees = rng.uniform(0.15, 0.22), rng.uniform(0.08, 0.13)
    look, sway, round_back = rng.uniform(-42, -12), rng.uniform(2, 6), rng.uniform(-4, 8)
    elbow: Point = (rng.uniform(0.4, 0.9), 0.2, -0.8)
    pelvis = _PELVIS - rng.uniform(0.0, 0.01)

    def at(body: float, hands: dict[str, float], feet: dict[str, float], lifted: str) -> Posture:
        """A body with its hips at a place along the way, and each limb at its own; `lifted`: the side of the hand in
        the air, if any; the knee of the other side slides over the floor."""
        lean = SIGN.get(lifted, 0.0) * sway
        other = OTHER_SIDE.get(lifted, "")
        places = {
            side: HandPlace((wide, 0.05 + _LIFT * (side == lifted), hands[side] + _SHOULDERS + 0.04), "floor", elbow)
            for side in SIDES
        }
        shanks = {
            side: FootPlace((knees, _ANKLE + 0.02 * (side == other), feet[side] - _SHANK + 0.02), _FOOT)
            for side in SIDES
        }
        posture = Posture(
            (0.01 * lean, pelvis, body), (_TILT, 0, 0), (round_back, 0.4 * lean, lean), (look, 0, -0.5 * lean)
        )
        return replace(posture, hands=places, feet=shanks, knees=dict.fromkeys(SIDES, (0.1, -0.8, 0.6)))

    done = _moved(at, rng.choice(SIDES), stride, period, cycles)
    kinds = ["crawl-back" if back else "crawl", f"crawl-{tempo}" if tempo and not back else ""]
    untrue = "belly|army|low crawl|forward|along" if back else "belly|army|low crawl"
    gesture = done.gesture(rng, kinds)
    return replace(gesture, seconds=done.times[-1], untrue=untrue)


def _over(metres: float | None, cycles: int, stride: float) -> tuple[int, float]:
    """Return how often each limb moves, and the metres that it moves at once, less than 0 = backward.

    They are changed where the body is to go a number of metres.
    """
    if metres is None:
        return cycles, stride
    often = max(round(metres / abs(stride)), 1)
    return often, metres / often * (1.0 if stride > 0 else -1.0)


def _moved(at: _PostureAt, side: str, stride: float, period: float, cycles: int) -> Sequel:
    """Return a crawl: the hand of one side, `side` at first, and the leg of the other move, then the other two.

    Args:
        at: draws a body from the place of its hips along the way, those of its hands and of its legs, metres, and the
            side of the hand that moves, empty if none does.
        side: of the hand that moves first.
        stride: metres that each limb moves at once; less than 0 = backward.
        period: seconds in which each limb moves once.
        cycles: how often each moves.
    """
    other, quarter, where = OTHER_SIDE[side], 0.25 * stride, 0.0
    hands, feet = {side: -quarter, other: quarter}, {side: quarter, other: -quarter}
    done = Sequel([0.0], [at(where, hands, feet, "")])
    for k in range(2 * cycles):
        moves, stays = (side, other) if k % 2 == 0 else (other, side)
        halfway = {moves: hands[moves] + 0.5 * stride, stays: hands[stays]}
        drawn_up = {stays: feet[stays] + 0.5 * stride, moves: feet[moves]}
        done.then(0.25 * period, at(where + quarter, halfway, drawn_up, moves))
        hands, feet = {**hands, moves: hands[moves] + stride}, {**feet, stays: feet[stays] + stride}
        where += 0.5 * stride
        done.then(0.25 * period, at(where, hands, feet, ""))
    return done


_LOW_PELVIS = 0.14
"""Metres of the hips over the floor in a crawl on the belly."""
_LOW_SHOULDERS = 0.44
"""Metres of the shoulders ahead of the hips."""
_LOW_PACES = {"slow": (1.9, 2.4), "": (1.35, 1.75), "quick": (1.0, 1.2)}
"""Seconds in which each limb moves once."""
_BELOW: Point = (0.9, -0.5, -0.5)
"""Where the elbow of an arm on the floor points: outward, up and forward."""


@dataclass(frozen=True)
class _LowForm:
    """The part of a crawl on the belly that stays: how wide hands and feet are put, metres, and the angles of the trunk
    and the neck, degrees."""

    hands: float
    feet: float
    raised: float
    look: float
    sway: float


def low_crawl(
    rng: random.Random, *, back: bool = False, seconds: float | None = None, metres: float | None = None
) -> Gesture:
    """Flat on the floor: the forearm of one side and the knee of the other move ahead, then the body is drawn after.

    Args:
        rng: decides everything that is not given.
        back: backward.
        seconds: for about how long.
        metres: how far; None = as far as it comes.
    """
    tempo = rng.choice(["slow", "", "", "quick"])
    period = rng.uniform(*_LOW_PACES[tempo])
    stride = rng.uniform(0.5, 0.62) * (-0.6 if back else 1.0)
    form = _LowForm(
        rng.uniform(0.16, 0.22), rng.uniform(0.1, 0.15), rng.uniform(14, 20), rng.uniform(-44, -34), rng.uniform(7, 12)
    )
    cycles = max(2, round((seconds or rng.uniform(4.0, 7.0)) / period))
    cycles, stride = _over(metres, cycles, stride)
    done = _moved(partial(_flat, form), rng.choice(SIDES), stride, period, cycles)
    gesture = done.gesture(rng, ["crawl-low"])
    return replace(gesture, seconds=done.times[-1])


def _flat(form: _LowForm, where: float, hands: dict[str, float], feet: dict[str, float], lifted: str) -> Posture:
    """A body on its belly with its hips at a place along the way, and each limb at its own; `lifted`: the side of the
    hand that moves, if any."""
    lean = SIGN.get(lifted, 0.0) * form.sway
    places, shanks, knees = {}, {}, dict[str, Point]()
    for side in SIDES:
        ahead = hands[side] + _LOW_SHOULDERS + 0.25
        places[side] = HandPlace((form.hands, 0.04 + 0.04 * (side == lifted), ahead), "floor", _BELOW)
        drawn_up = min(max((feet[side] - where + 0.16) / 0.32, 0.0), 1.0)
        wide = form.feet + 0.16 * drawn_up
        shanks[side] = FootPlace((wide, 0.05, feet[side] - 0.64), (0.45 + 0.4 * drawn_up, -0.12, -0.8), drags=True)
        knees[side] = (1.0, -0.12, 0.3)
    posture = Posture(
        (0.012 * lean / form.sway, _LOW_PELVIS, where),
        (86, 0.5 * lean, 0.5 * lean),
        (-form.raised, -0.6 * lean, 0.7 * lean),
        (form.look, 0, -0.8 * lean),
    )
    return replace(posture, hands=places, feet=shanks, knees=knees)
