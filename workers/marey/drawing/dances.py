"""Basic steps of dances that have a name, on the spot: salsa, cha-cha, bachata, waltz, and a two-step of hip hop.

A dance is a round of steps on counts; the hips go over the foot that stands, and tilt and turn with it.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN

_Place = tuple[float, float]
_APART = 0.1
"""Metres of a foot from the middle where it stands beside the other."""


@dataclass(frozen=True)
class _Step:
    """A step: counts that it takes, its foot, where to, metres to the left and forward of that foot's own place, and
    True if the foot taps the floor and the weight stays on the other."""

    counts: float
    side: str
    at: _Place
    taps: bool = False


@dataclass(frozen=True)
class _Dance:
    """A dance.

    Attributes:
        count_s: bounds of the seconds of a count.
        steps: of a round.
        hips: degrees by which the hips tilt towards the foot that stands, and turn.
        falls: metres by which the hips sink as a foot lands, and by which they are low throughout.
        lift: metres of a foot on its way.
        hands: places of the wrists by side; see `HandPlace` (at the shoulders).
        swings: metres by which a hand goes ahead with the foot of the other side.
    """

    count_s: tuple[float, float]
    steps: tuple[_Step, ...]
    hips: tuple[float, float]
    falls: tuple[float, float]
    lift: float
    hands: Mapping[str, tuple[float, float, float]]
    swings: float


_WAIST = {LEFT: (0.13, -0.3, 0.24), RIGHT: (0.13, -0.3, 0.24)}
_FRAME = {LEFT: (0.34, 0.02, 0.26), RIGHT: (0.12, -0.14, 0.34)}
_ALOFT = {LEFT: (0.16, 0.36, 0.12), RIGHT: (0.16, 0.36, 0.12)}
_LOW = {LEFT: (0.16, -0.36, 0.16), RIGHT: (0.16, -0.36, 0.16)}
DANCES: Mapping[str, _Dance] = {
    "salsa": _Dance(
        (0.34, 0.38),
        (
            _Step(1, LEFT, (0.0, 0.28)),
            _Step(1, RIGHT, (0.0, 0.0)),
            _Step(2, LEFT, (0.0, 0.0)),
            _Step(1, RIGHT, (0.0, -0.28)),
            _Step(1, LEFT, (0.0, 0.0)),
            _Step(2, RIGHT, (0.0, 0.0)),
        ),
        (9.0, 8.0),
        (0.012, 0.025),
        0.045,
        _WAIST,
        0.2,
    ),
    "cha-cha": _Dance(
        (0.46, 0.5),
        (
            _Step(1, LEFT, (0.0, 0.26)),
            _Step(1, RIGHT, (0.0, 0.0)),
            _Step(0.5, LEFT, (0.2, 0.0)),
            _Step(0.5, RIGHT, (0.2, 0.0)),
            _Step(1, LEFT, (0.4, 0.0)),
            _Step(1, RIGHT, (0.2, -0.26)),
            _Step(1, LEFT, (0.4, 0.0)),
            _Step(0.5, RIGHT, (0.0, 0.0)),
            _Step(0.5, LEFT, (0.2, 0.0)),
            _Step(1, RIGHT, (-0.2, 0.0)),
            _Step(1, LEFT, (0.0, 0.0)),
            _Step(1, RIGHT, (0.0, 0.0)),
        ),
        (7.0, 6.0),
        (0.01, 0.02),
        0.04,
        _WAIST,
        0.2,
    ),
    "bachata": _Dance(
        (0.44, 0.48),
        (
            _Step(1, LEFT, (0.3, 0.0)),
            _Step(1, RIGHT, (0.3, 0.0)),
            _Step(1, LEFT, (0.6, 0.0)),
            _Step(1, RIGHT, (0.56, 0.06), True),
            _Step(1, RIGHT, (0.3, 0.0)),
            _Step(1, LEFT, (0.3, 0.0)),
            _Step(1, RIGHT, (0.0, 0.0)),
            _Step(1, LEFT, (0.04, 0.06), True),
        ),
        (10.0, 4.0),
        (0.012, 0.03),
        0.045,
        _WAIST,
        0.18,
    ),
    "waltz": _Dance(
        (0.56, 0.64),
        (
            _Step(1, LEFT, (0.0, 0.36)),
            _Step(1, RIGHT, (-0.34, 0.36)),
            _Step(1, LEFT, (-0.34, 0.36)),
            _Step(1, RIGHT, (-0.34, 0.0)),
            _Step(1, LEFT, (0.0, 0.0)),
            _Step(1, RIGHT, (0.0, 0.0)),
        ),
        (2.0, 3.0),
        (0.02, 0.01),
        0.05,
        _FRAME,
        0.0,
    ),
    "hip-hop": _Dance(
        (0.5, 0.56),
        (
            _Step(1, LEFT, (0.3, 0.0)),
            _Step(1, RIGHT, (0.26, 0.02), True),
            _Step(1, RIGHT, (0.0, 0.0)),
            _Step(1, LEFT, (0.04, 0.02), True),
        ),
        (5.0, 10.0),
        (0.06, 0.05),
        0.06,
        _LOW,
        0.18,
    ),
    "victory": _Dance(
        (0.42, 0.48),
        (
            _Step(1, LEFT, (0.24, 0.05)),
            _Step(1, RIGHT, (0.2, 0.0), True),
            _Step(1, RIGHT, (0.0, 0.05)),
            _Step(1, LEFT, (0.04, 0.0), True),
        ),
        (8.0, 14.0),
        (0.07, 0.03),
        0.09,
        _ALOFT,
        0.14,
    ),
}
"""Dances by name."""


def dance_basic(rng: random.Random, name: str, *, seconds: float | None = None, brief: bool = False) -> Gesture:
    """The basic step of a dance, round after round.

    Args:
        rng: decides sizes and times.
        name: key of `DANCES`.
        seconds: to be filled; None = for six to eight, or about four.
        brief: other things are done before or after it.

    Raises:
        KeyError: no such dance.
    """
    dance, size, starts = DANCES[name], rng.uniform(0.92, 1.05), 0.1 if brief else rng.uniform(0.2, 0.35)
    count_s = rng.uniform(*dance.count_s)
    once = count_s * sum(step.counts for step in dance.steps)
    lasts = seconds or (4.0 if brief else rng.uniform(6.0, 8.0))
    rounds = max(round((lasts - starts - 0.8) / once), 1)

    def sequel(feet: StandingFeet) -> Sequel:
        done = Sequel([starts])
        at: dict[str, _Place] = {side: (0.0, feet[side].forward) for side in SIDES}
        for _ in range(rounds):
            for step in dance.steps:
                there = (size * step.at[0], size * step.at[1] + feet[step.side].forward)
                _add_step(done, dance, at, (step, there), count_s)
                at[step.side] = there
        last = dance.steps[-1]
        stands = at[OTHER_SIDE[last.side] if last.taps else last.side]
        done.then(0.45, Posture((stands[0], 0.94, stands[1]), feet={side: _foot(side, stands) for side in SIDES}))
        return done

    return on_feet(sequel, ["dance", f"dance-{name}"], 0.15 if brief else 0.35, times=rounds)


def _add_step(
    done: Sequel, dance: _Dance, at: Mapping[str, _Place], moved: tuple[_Step, _Place], count_s: float
) -> None:
    """Add a step from where the feet are: over the way, and where the foot lands."""
    (step, there), lasts = moved, count_s * moved[0].counts
    side, other = step.side, OTHER_SIDE[step.side]
    stands = other if step.taps else side
    begun = at[side]
    half = (0.5 * (begun[0] + there[0]), 0.5 * (begun[1] + there[1]))
    quick = min(0.5 * lasts, 0.3)
    passing = _posture(dance, {side: half, other: at[other]}, (other, 0.82), side, dance.lift)
    done.then(quick * 0.5, passing)
    landed = _posture(dance, {side: there, other: at[other]}, (stands, 0.7), side, 0.02 if step.taps else 0.0)
    done.then(quick * 0.5, landed)
    if lasts - quick > 0.05:
        settled = _posture(dance, {side: there, other: at[other]}, (stands, 0.84), side, 0.02 if step.taps else 0.0)
        done.then(lasts - quick, settled)


def _posture(dance: _Dance, at: Mapping[str, _Place], over: tuple[str, float], steps: str, lifted: float) -> Posture:
    """The posture over feet.

    Args:
        dance: that is danced.
        at: place of each foot, to the left and forward of its own.
        over: the foot that stands, and the share of the weight on it.
        steps: the foot that steps, which is `lifted` by metres.
    """
    stands, share = over
    other = OTHER_SIDE[stands]
    places = {side: (SIGN[side] * _APART + at[side][0], at[side][1]) for side in SIDES}
    hips = tuple(share * a + (1 - share) * b for a, b in zip(places[stands], places[other], strict=True))
    sinks, low = dance.falls
    tilt, turn = (SIGN[stands] * each for each in dance.hips)
    up = 0.935 - low - (sinks if not lifted else 0.0)
    ahead = at[LEFT][1] - at[RIGHT][1]
    hands = {
        side: HandPlace(
            (
                place[0],
                place[1],
                place[2] - SIGN[side] * dance.swings * (1.0 if ahead > 0 else -1.0 if ahead < 0 else 0),
            ),
            "shoulder",
            (0.7, -0.8, -0.5),
        )
        for side, place in dance.hands.items()
    }
    feet = {side: _foot(side, at[side], lifted if side == steps else 0.0) for side in SIDES}
    return Posture(
        (hips[0], up, hips[1]), (1, -tilt, -turn), (2, tilt, 0.8 * turn), (0, 0, 0.2 * turn), hands=hands, feet=feet
    )


def _foot(side: str, at: _Place, up: float = 0.0) -> FootPlace:
    """A foot at a place to the left and forward of its own."""
    return FootPlace((_APART + SIGN[side] * at[0], 0.07 + up, at[1]))
