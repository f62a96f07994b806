"""Rules of climbs, loads, wheels and balls, and of bodies that hang or swim."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, HIPS, PELVIS, SHOULDERS, WRISTS, swings, velocity
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.selector.floor import seated
from marey.selector.gaits import walks
from marey.selector.grades import best, every, least, most, of_side
from marey.selector.motion import Array, Motion


def carry(m: Motion, side: str) -> float:
    """Walk with a load."""
    near = np.linalg.norm(m.reach, axis=-1) < 0.3
    before = (m.ahead[..., 0] > 0.12) & (m.joints[:, list(WRISTS), 1] > m.joints[:, [PELVIS], 1] - 0.08)
    held = (near | before) & (m.still < 0.6) & (m.elbows > 20)
    return min(least(max(m.most(held[:, k]) for k in (0, 1)), 0.6, 0.15), walks(m), most(abs(m.turn), 120, 30))


def climb_onto(m: Motion, side: str) -> float:
    """Get onto or over something high."""
    feet, few = m.feet, max(round(0.3 * m.fps), 1)
    held = np.array([feet[a : a + few].min() for a in range(max(m.frames - few, 1))])
    rise = float(held.max()) - float(np.median(feet[:few].min(axis=1)))
    step = least(float(np.abs(feet[:, 0] - feet[:, 1]).max()), 0.22, 0.06)
    return min(least(rise, 0.4, 0.12), step)


def hang(m: Motion, side: str) -> float:
    """Hang by the hands."""
    over = every(m.joints[:, list(WRISTS), 1] > m.joints[:, [HEAD], 1])
    hold = np.linalg.norm(velocity(smooth_seconds(m.joints[:, list(WRISTS)], 0.1, m.fps), m.fps), axis=-1) < 0.5
    return least(m.longest(over & every(hold) & (m.feet.min(axis=1) > 0.06)), 1.0, 0.25)


def swim(m: Motion, side: str) -> float:
    """Sweep arms and kick legs in water."""
    free = ((m.feet.min(axis=1) > 0.05) | (m.tilt > 45)) & (m.tilt > 15)
    arms = max(len(swings(m.reach[:, k, c], 0.25)) for k in (0, 1) for c in range(3))
    gap = m.joints[:, ANKLES[0]] - m.joints[:, ANKLES[1]]
    apart = np.linalg.norm(gap, axis=-1)
    legs = max(max(len(swings(gap[:, c], 0.1)) for c in range(3)), len(swings(apart, 0.1)))
    return min(least(m.most(free), 0.6, 0.15), least(arms, 2.5, 1), least(legs, 2.5, 1))


def drive(m: Motion, side: str) -> float:
    """Turn a steering wheel, seated."""
    line = m.hands[:, 0] - m.hands[:, 1]
    apart = np.linalg.norm(line, axis=-1)
    held = every(m.ahead[..., 0] > 0.15) & (apart > 0.22) & (apart < 0.65) & seated(m)
    angle = np.degrees(np.unwrap(np.arctan2(line[:, 1], np.abs(line[:, 2]))))
    return min(least(m.most(held), 0.55, 0.15), least(float(np.ptp(smooth_seconds(angle, 0.1, m.fps))), 15, 6))


def twist(m: Motion, side: str) -> float:
    """Turn the shoulders against the hips, to and fro."""

    def yaw(pair: tuple[int, int]) -> Array:
        line = m.joints[:, pair[0]] - m.joints[:, pair[1]]
        return np.degrees(np.unwrap(np.arctan2(-line[:, 2], line[:, 0])))

    against = smooth_seconds(yaw(SHOULDERS) - yaw(HIPS), 0.05, m.fps)
    against -= 360 * np.round(float(np.median(against)) / 360)
    turns = swings(against, 25)
    sides = [against[a] * against[b] < 0 and min(abs(against[a]), abs(against[b])) > 8 for a, b in pairwise(turns)]
    return min(
        least(sum(sides), 1.5, 1), most(m.path, 0.2 * m.seconds + 0.4, 0.3), least(float(np.median(m.hips)), 0.8, 0.06)
    )


def dribble(m: Motion, side: str) -> float:
    """Bounce a ball with a hand."""
    strokes = [0.0, 0.0]
    height = m.joints[:, list(WRISTS), 1]
    low = (height > 0.4) & (m.hands[..., 1] < 0.05) & (m.ahead[..., 0] > -0.15)
    for k in (0, 1):
        for a, b in runs(low[:, k]):
            turns = swings(m.hands[a:b, k, 1], 0.08)
            halves = np.diff(turns) / m.fps
            strokes[k] = max(strokes[k], float(np.sum((halves > 0.12) & (halves < 0.6))) / 2)
    one = of_side([least(each, 2.8, 1) for each in strokes], side)
    return min(one, least(float(np.median(m.hips)), 0.65, 0.06))


def shoot_basket(m: Motion, side: str) -> float:
    """Push a ball from the chest up over the head."""
    height = m.hands[..., 1].copy()
    both, lead = height.min(axis=1), height.max(axis=1)
    gap = np.linalg.norm(m.joints[:, WRISTS[0]] - m.joints[:, WRISTS[1]], axis=-1)
    rising = velocity(lead, m.fps)
    window = round(1.0 * m.fps)
    grades = [0.0]
    for a, b in runs((lead > 0.22) & (both > 0.0)):
        first = max(a - window, 0)
        low = most(float(lead[first : a + 1].min()), 0.02, 0.1)
        near = most(float(gap[first:b].min()), 0.4, 0.1)
        fast = least(float(rising[first:b].max()), 1.2, 0.4)
        ahead = least(float(m.ahead[a:b, :, 0].max()), 0.1, 0.08)
        top = least(float(lead[a:b].max()), 0.32, 0.08)
        grades.append(min(low, near, fast, ahead, top))
    return min(best(grades), least(float(np.median(m.hips)), 0.75, 0.08))
