"""A slash out of a turn all the way round: the body spins over one foot with the blade held out."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.drawing.stances import turn_about_foot
from marey.posing.standing import LEFT, RIGHT, StandingBody

MOST_TURNS = 3
_TURN_S = 0.62
"""Seconds of each turn after the first."""


def spun_slash(rng: random.Random, side: str = "", turns: int | None = None, *, two_handed: bool = False) -> Gesture:
    """A body on guard that winds up, turns all the way round with the blade out, and cuts through as it comes round.

    Args:
        rng: decides everything that is not given.
        side: of the hand with the blade; empty = right.
        turns: how many; None = one.
        two_handed: both hands are on the handle.
    """
    side, pace, turns = side or RIGHT, rng.uniform(0.95, 1.1), min(turns or 1, MOST_TURNS)
    ahead, apart = FootPlace((0.1, 0.07, 0.12)), FootPlace((0.14, 0.07, -0.22))
    passing = FootPlace((0.14, 0.14, -0.08), (0.1, -0.5, 0.85))

    def held(right: Point, left: Point) -> dict[str, HandPlace]:
        """Wrists over the shoulders: of the hand with the blade, and of the other, which is at it if both hold it."""
        other = (-right[0] - 0.04, right[1] - 0.08, right[2]) if two_handed else left
        return {RIGHT: HandPlace(right, "trunk", (0.7, -0.8, -0.2)), LEFT: HandPlace(other, "trunk", (0.6, -0.9, -0.3))}

    far = 0.34 if two_handed else 0.48
    ready = held((-0.02, -0.2, 0.34), (0.12, -0.24, 0.22))
    wound = held((-0.3, -0.12, 0.2), (0.3, -0.3, 0.0))
    out = held((0.02 if two_handed else far, -0.12, 0.44 if two_handed else 0.14), (0.36, -0.2, -0.06))
    cut = held((0.1, -0.08, 0.46), (0.34, -0.24, -0.08))
    ends = held((0.24 if two_handed else far - 0.06, -0.18, 0.36 if two_handed else 0.12), (0.28, -0.3, 0.0))
    guard = Posture((0.0, 0.88, 0.0), (6, 0, 0), (6, 0, 0), hands=ready, feet={LEFT: ahead, RIGHT: apart})
    winds = replace(guard, pelvis=(0.0, 0.83, 0.0), tilt=(6, 0, 14), spine=(8, 0, 30), neck=(0, 0, -26), hands=wound)
    spins = replace(
        guard, pelvis=(0.0, 0.86, 0.03), spine=(6, 0, -4), neck=(0, 0, -18), hands=out,
        feet={LEFT: ahead, RIGHT: passing},
    )  # fmt: skip
    hits = replace(guard, pelvis=(0.0, 0.84, 0.02), spine=(10, 0, -10), hands=cut)
    through = replace(hits, spine=(8, 0, -30), neck=(0, 0, 20), hands=ends)
    done = Sequel([rng.uniform(0.15, 0.35)])
    done.then(0.5 * pace, guard, 0.1)
    done.then(0.4 * pace, winds, 0.06)
    begins = done.times[-1]
    done.then(0.2 * pace, spins)
    done.then((0.28 + _TURN_S * (turns - 1)) * pace, spins)
    done.then(0.16 * pace, hits)
    comes = done.times[-1]
    done.then(0.14 * pace, through, 0.2)
    done.then(0.45 * pace, guard, 0.2)
    done.then(0.6, STAND)
    told = done if side == RIGHT else done.mirrored()
    gesture = told.gesture(rng, ["slash", "spin"], side)
    sign = -1.0 if side == RIGHT else 1.0
    round_, span = 360.0 * turns, comes - begins
    shares = ((0.0, 0.0), (0.2, 0.12), (0.85, 0.88), (1.0, 1.0))
    times = [begins + share * span for share, _ in shares]
    degrees = [sign * round_ * done_ for _, done_ in shares]

    def change(body: StandingBody) -> None:
        gesture.change(body)
        turn_about_foot(body, LEFT if side == RIGHT else RIGHT, times, degrees)

    return replace(gesture, change=change)
