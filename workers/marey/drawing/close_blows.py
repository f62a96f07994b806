"""Blows at close range: headbutts, slaps, and a backfist out of a turn. All are drawn for the right hand and mirrored
for the left one."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import Gesture
from marey.drawing.postures import LOWERED, STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, both
from marey.drawing.stances import turn_about_foot
from marey.posing.standing import LEFT, RIGHT, StandingBody

_GUARD = {
    LEFT: HandPlace((0.06, -0.02, 0.3), "trunk", (0.5, -1.0, -0.1)),
    RIGHT: HandPlace((0.08, -0.04, 0.22), "trunk", (0.5, -1.0, -0.1)),
}
_SEIZES = HandPlace((-0.02, -0.04, 0.42), "shoulder", (0.8, -0.7, -0.1))
_PULLS = HandPlace((0.02, -0.16, 0.3), "shoulder", (0.9, -0.5, -0.4))
"""Hands at the collar of an opponent, and pulling it near."""


def headbutt(rng: random.Random, times: int = 1) -> Gesture:
    """A body that seizes an opponent before it, draws back, and snaps its head and trunk forward.

    Args:
        rng: decides everything that is not given.
        times: how many blows.
    """
    pace, far = rng.uniform(0.95, 1.1), rng.uniform(0.3, 0.38)
    feet = {LEFT: FootPlace((0.1, 0.07, far))}
    seizes = Posture((0.0, 0.9, 0.5 * far), (4, 0, 0), (2, 0, 0), hands=both(_SEIZES), feet=feet)
    drawn = Posture((0.0, 0.9, 0.4 * far), (-6, 0, 0), (-14, 0, 0), (-24, 0, 0), hands=both(_SEIZES), feet=feet)
    struck = Posture((0.0, 0.87, 0.62 * far), (16, 0, 0), (26, 0, 0), (20, 0, 0), hands=both(_PULLS), feet=feet)
    done = Sequel([rng.uniform(0.2, 0.5)])
    done.then(0.5 * pace, seizes, 0.06)
    for _ in range(times):
        done.then(0.32 * pace, drawn, 0.05)
        done.then(0.15, struck, 0.06)
        done.then(0.3 * pace, seizes, 0.06)
    done.then(0.6 * pace, STAND)
    return done.gesture(rng, ["headbutt"], times=times)


def slap(rng: random.Random, side: str = "", times: int = 1, *, back: bool = False) -> Gesture:
    """A blow with the open hand across a face before the body, with the turn of the trunk behind it.

    Args:
        rng: decides everything that is not given.
        side: of the hand.
        times: how many.
        back: with the back of the hand, from the other side.
    """
    side, pace, high = side or rng.choice((RIGHT, RIGHT, LEFT)), rng.uniform(0.95, 1.1), rng.uniform(0.02, 0.1)
    outside = HandPlace((0.34, high - 0.1, 0.04), "shoulder", (0.6, -0.7, -0.6))
    passes = HandPlace((-0.04, high, 0.46), "shoulder", (0.6, -1.0, -0.1))
    inside = HandPlace((-0.36, high - 0.04, 0.26), "shoulder", (0.5, -0.8, 0.3))
    first, last, sign = (inside, outside, -1.0) if back else (outside, inside, 1.0)
    waits = LOWERED
    over = (-0.02, 0.92, 0.03)
    wound = Posture(over, (2, 0, -8 * sign), (2, 0, -22 * sign), (0, 0, 16 * sign), hands={RIGHT: first, LEFT: waits})
    hit = Posture(over, (5, 0, 6 * sign), (5, 0, 14 * sign), (0, 0, -10 * sign), hands={RIGHT: passes, LEFT: waits})
    through = replace(hit, tilt=(6, 0, 10 * sign), spine=(6, 0, 26 * sign), hands={RIGHT: last, LEFT: waits})
    done = Sequel([rng.uniform(0.3, 0.6)])
    for _ in range(times):
        done.then(0.42 * pace, wound, 0.04)
        done.then(0.13, hit)
        done.then(0.14, through, 0.08)
    done.then(0.6 * pace, STAND)
    told = done if side == RIGHT else done.mirrored()
    return told.gesture(rng, ["slap"], side, times)


def spun_backfist(rng: random.Random, side: str = "") -> Gesture:
    """A body in guard that turns all the way round over its hind foot, and strikes with the back of the fist as it
    comes round.

    Args:
        rng: decides everything that is not given.
        side: of the hand.
    """
    side, pace = side or rng.choice((RIGHT, RIGHT, LEFT)), rng.uniform(0.95, 1.1)
    ahead, apart = FootPlace((0.1, 0.07, 0.12)), FootPlace((0.12, 0.07, -0.2))
    passing = FootPlace((0.12, 0.13, -0.08), (0.1, -0.5, 0.85))
    guard = Posture((0.0, 0.9, 0.0), (6, 0, 0), (6, 0, 0), hands=_GUARD, feet={LEFT: ahead, RIGHT: apart})
    folded = HandPlace((-0.06, -0.02, 0.22), "trunk", (0.9, -0.5, 0.2))
    swings = HandPlace((0.46, 0.02, 0.12), "shoulder", (0.3, -0.9, -0.4))
    struck = HandPlace((0.2, 0.08, 0.46), "shoulder", (0.6, -0.8, -0.1))
    starts = replace(guard, spine=(6, 0, -16), hands={**_GUARD, RIGHT: folded}, feet={LEFT: ahead, RIGHT: passing})
    comes = replace(starts, spine=(4, 0, 10), neck=(0, 0, -24), hands={**_GUARD, RIGHT: swings})
    hit = replace(guard, spine=(6, 0, -8), neck=(0, 0, 0), hands={**_GUARD, RIGHT: struck})
    done = Sequel([rng.uniform(0.15, 0.4)])
    done.then(0.5, guard, 0.15)
    done.then(0.28 * pace, starts)
    done.then(0.24 * pace, comes)
    done.then(0.14 * pace, hit, 0.07)
    done.then(0.4 * pace, guard, 0.3)
    done.then(0.6, STAND)
    told = done if side == RIGHT else done.mirrored()
    gesture = told.gesture(rng, ["backfist"], side)
    sign = -1.0 if side == RIGHT else 1.0
    degrees = [sign * each for each in (0.0, 120.0, 290.0, 350.0, 360.0)]

    def change(body: StandingBody) -> None:
        gesture.change(body)
        turn_about_foot(body, LEFT if side == RIGHT else RIGHT, done.times[2:7], degrees)

    return replace(gesture, change=change)
