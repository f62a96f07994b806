"""Weight of a standing body that gestures: hips that shift from leg to leg, and a spine that goes with the arms.

A gesture is drawn on arms; of waves, claps and drinks nothing else moved but the breath of the idle that they are drawn
on. Feet stay where they are, the knees are solved, and the first and the last pose are those of the gesture.
"""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.stances import glide
from marey.motion.filters import smooth
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEFT, LEGS, StandingBody, eased

Array = NDArray[np.floating]

WEIGHS = frozenset(
    {
        *("wave", "raise-arm", "clap", "cheer", "signal", "guide", "drink", "wash", "reach-up", "reach-forward"),
        *("arm-circles", "talk"),
    }
)
"""Actions of the arms of a body that stands, whose weight shifts."""
STAYS_M, RESTS_M = 0.03, 0.03
"""Metres by which feet move, and hips over the floor, of a body that stands and does not shift by itself, at most."""
SHIFTS_M, SHIFTS_S = 0.024, (1.6, 2.8)
"""Metres by which hips shift to a side at most, and the seconds from one leg to the other."""
COUNTERS, MOST_M = 0.05, 0.015
"""Metres by which hips go away from hands for each metre that these are aside, and at most."""
FOLLOWS, PITCHES = 0.03, 9.0
"""Metres by which hips go ahead, and degrees by which the spine bends, for each metre that the hands come ahead."""
SINKS = 0.12
"""Share of a shift to a side by which the hips are lower."""
LEANS, TWISTS = 95.0, 1.8
"""Degrees by which the spine leans back over the feet for each metre of a shift, and by which it twists at most."""
ENDS_S, FILTER_S = 0.6, 0.2
"""Seconds in which it begins and ends, and standard deviation of the filter of what the hands do."""


def with_weight(joints: Array, rng: random.Random) -> Array:
    """Return joints (T, 22, 3), metres, of a body whose weight shifts; as they are where its feet or hips move.

    Args:
        joints: at 20 fps, of a body that stands and gestures.
        rng: decides the shifts.
    """
    feet = joints[:, [joint for leg in LEGS.values() for joint in leg[2:]]]
    hips = joints[:, 0][:, [0, 2]]
    if np.ptp(feet, axis=0).max() > STAYS_M or np.ptp(hips, axis=0).max() > RESTS_M:
        return joints
    body, frames = StandingBody(joints.copy()), len(joints)
    time = np.arange(frames) / FPS
    amount = eased(np.minimum(time, time[-1] - time) / ENDS_S)
    aside, ahead = _hands(body)
    left = SHIFTS_M * _wander(rng, frames) - np.clip(COUNTERS * aside, -MOST_M, MOST_M)
    body.shift(-SINKS * np.abs(left) * amount, FOLLOWS * ahead * amount, left * amount)
    body.lean(LEANS * left * amount, "forward")
    body.lean(PITCHES * ahead * amount, "left")
    body.lean(TWISTS * _wander(rng, frames) * amount, "up")
    return body.solved()


def _hands(body: StandingBody) -> tuple[Array, Array]:
    """Return how far (T,) both hands are to the left and ahead of where they are in the first frame, metres."""
    joints = body.joints
    wrists = joints[:, [arm[3] for arm in ARMS.values()]].mean(axis=1)
    seen = body.local(wrists - joints[:, 0], LEFT)
    moved = smooth(seen - seen[0], FILTER_S * FPS)
    return moved[:, 0], np.maximum(moved[:, 2], 0.0)


def _wander(rng: random.Random, frames: int) -> Array:
    """Return a way (T,) from side to side, -1 to 1, that rests a little at each."""
    times, points, side = [0.0], [[0.0]], rng.choice((-1.0, 1.0))
    while times[-1] < frames / FPS:
        reached = times[-1] + rng.uniform(*SHIFTS_S)
        there = side * rng.uniform(0.5, 1.0)
        times += [reached, reached + rng.uniform(0.3, 0.8)]
        points += [[there], [0.9 * there]]
        side = -side
    return glide(frames, times, points)[:, 0]
