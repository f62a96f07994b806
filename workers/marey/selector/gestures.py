"""Rules of gestures: signs, talk, laughter, and what hands do before the body."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import KNEES, PELVIS, SHOULDERS, WRISTS, swings
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.selector.gaits import stays
from marey.selector.grades import every, least, most, of_side, share, some
from marey.selector.motion import Array, Bool, Motion


def _stands(m: Motion) -> float:
    """Grade that the body stands, or kneels or sits where it is."""
    rests = most(float(np.ptp(m.hips)), 0.1, 0.03)
    return max(least(float(np.median(m.hips)), 0.8, 0.06), rests)


def laugh(m: Motion, side: str) -> float:
    """Rock and shake."""
    bends = len(swings(m.lean, 7)) - 1
    shoulders = m.joints[:, list(SHOULDERS), 1] - m.joints[:, [PELVIS], 1]
    quick = smooth_seconds(shoulders - smooth_seconds(shoulders, 0.2, m.fps), 0.02, m.fps).mean(axis=1)
    shakes = (len(swings(quick, 0.003)) - 1) / m.seconds
    return min(least(bends, 2.5, 1), max(least(shakes, 1.5, 1), 0.6), stays(m), most(float(m.tilt.max()), 75, 10))


def nod(m: Motion, side: str) -> float:
    """Tip the head down and up twice."""
    nods = swings(smooth_seconds(m.pitch, 0.03, m.fps), 7)
    times = np.diff(nods) / m.fps
    steady = min(most(float(np.ptp(m.lean)), 14, 5), most(m.extent, 0.2, 0.08))
    return min(least(sum(times < 1.2), 2.5, 1), steady, most(float(np.percentile(m.hand_speed, 95)), 1.0, 0.4))


def _held(m: Motion, away: Bool, fastest: float, seconds: float) -> list[tuple[int, Array]]:
    """Return the places at which a hand is held away from the trunk for a while, with the frame, in order."""
    found = list[tuple[int, Array]]()
    for k in (0, 1):
        for a, b in runs(away[:, k] & (m.still[:, k] < fastest)):
            if b - a >= seconds * m.fps:
                found.append((a, np.append(m.hands[a:b, k].mean(axis=0), 10.0 * k)))
    return sorted(found, key=lambda each: each[0])


def signal(m: Motion, side: str) -> float:
    """Direct others with large arm signs."""
    away = (np.hypot(m.ahead[..., 0], m.ahead[..., 2]) > 0.4) & (m.hands[..., 1] > -0.4) | (m.hands[..., 1] > 0.1)
    count, last = 0, {}
    for k in (0, 1):
        for frame, place in _held(m, away & (np.arange(2) == k), 0.8, 0.1):
            if k not in last or float(np.linalg.norm(place - last[k])) > 0.25 or _left(m, away, k, last[k], frame):
                count += 1
                last[k] = place
    turning = sum(max(len(swings(m.hands[:, k, 1], 0.3)), len(swings(m.hands[:, k, 2], 0.3))) for k in (0, 1))
    return min(least(count, 2.5, 1), least(turning, 2.5, 1), stays(m), _stands(m))


def _left(m: Motion, away: Bool, k: int, place: Array, frame: int) -> bool:
    """Return True if a hand came near the trunk in the second before a frame."""
    return not bool(away[max(frame - round(m.fps), 0) : frame, k].all())


def guide(m: Motion, side: str) -> float:
    """Stretch an arm out to show the way."""
    out = np.hypot(m.ahead[..., 0], m.ahead[..., 2]) > 0.4
    height = (m.joints[:, list(WRISTS), 1] > m.joints[:, [PELVIS], 1]) & (m.hands[..., 1] < 0.25)
    pose = out & height & (m.elbows < 75) & (m.still < 0.5) & (m.ahead[..., 0] > -0.2)
    grades = [least(m.longest(pose[:, k]), 0.5, 0.15) for k in (0, 1)]
    one = 1 - 0.7 * min(grades)
    return min(of_side(grades, side), one, stays(m), _stands(m))


def shiver(m: Motion, side: str) -> float:
    """Tremble with the arms close."""
    points = m.joints[:, [*WRISTS, *SHOULDERS, *KNEES]] - m.joints[:, [PELVIS]]
    quick = points - smooth_seconds(points, 0.12, m.fps)
    flat = quick.reshape(m.frames, -1)
    turns = sorted((len(swings(flat[:, c], 0.004)) / m.seconds for c in range(flat.shape[1])), reverse=True)
    near = every((np.hypot(m.ahead[..., 0], m.ahead[..., 2]) < 0.4) & (m.hands[..., 1] < 0.05) & (m.elbows > 50))
    return min(least(float(np.mean(turns[:3])), 4.5, 1.5), least(m.most(near), 0.6, 0.15), stays(m))


def talk(m: Motion, side: str) -> float:
    """Talk with the hands."""
    low = (m.joints[:, list(WRISTS), 1] > m.joints[:, [PELVIS], 1]) & (m.hands[..., 1] < 0.1) & (m.ahead[..., 0] > 0.08)
    speed = smooth_seconds(m.hand_speed, 0.2, m.fps)
    moves = some(low & (speed > 0.2) & (speed < 1.6))
    calm = most(float(np.percentile(m.hand_speed, 95)), 2.0, 0.5)
    small = most(share(some(m.hands[..., 1] > 0.15)), 0.15, 0.1)
    planted = least(share(every(m.foot_speed < 0.4)), 0.8, 0.15)
    count = max(max(len(swings(m.hands[:, k, c], 0.05)) for c in range(3)) for k in (0, 1))
    return min(least(share(moves), 0.33, 0.12), calm, small, planted, least(count, 3.5, 1.5), most(m.extent, 0.3, 0.1))


def wash(m: Motion, side: str) -> float:
    """Rub to and fro."""
    most_strokes = 0.0
    for k in (0, 1):
        front = (m.ahead[:, k, 0] > 0.1) & (m.elbows[:, k] > 8)
        for a, b in runs(front):
            if b - a > 8:
                way = m.hands[a:b, k] - smooth_seconds(m.hands[a:b, k], 0.7, m.fps)
                axes = np.linalg.svd(way - way.mean(axis=0), full_matrices=False)[2]
                turns = swings(way @ axes[0], 0.09)
                times = np.diff(turns) / m.fps
                most_strokes = max(most_strokes, float(np.sum(times < 1.5)))
    return min(least(most_strokes, 4.5, 1.5), most(m.path, 0.2 * m.seconds + 0.5, 0.3))


def reach_forward(m: Motion, side: str) -> float:
    """Reach ahead with one hand and come back."""
    grades = [0.0, 0.0]
    height = (m.joints[:, list(WRISTS), 1] > m.joints[:, [PELVIS], 1] - 0.05) & (m.hands[..., 1] < 0.15)
    for k in (0, 1):
        for a, b in runs((m.ahead[:, k, 0] > 0.36) & height[:, k]):
            ahead = least(float(m.ahead[a:b, k, 0].max()), 0.4, 0.05)
            rest = m.longest(m.still[:, k] < 0.55, a, b)
            before, after = float(m.ahead[: a + 1, k, 0].min()), float(m.ahead[b - 1 :, k, 0].min())
            back = min(most(before, 0.25, 0.08), most(after, 0.28, 0.08))
            grades[k] = max(grades[k], min(ahead, least(rest, 0.2, 0.1), back))
    slow = most(float(np.percentile(m.hand_speed.max(axis=1), 98)), 3.2, 0.8)
    return min(of_side(grades, side), 1 - 0.6 * min(grades), slow, stays(m), _stands(m))


def push(m: Motion, side: str) -> float:
    """Lean against something with both hands."""
    height = (m.hands[..., 1] > -0.5) & (m.hands[..., 1] < 0.15)
    pose = every((m.ahead[..., 0] > 0.22) & height) & (m.lean > 10)
    slow = most(float(np.percentile(np.hypot(*m.flow.T), 80)), 1.5, 0.3)
    return min(least(m.most(pose), 0.6, 0.15), slow, least(float(np.median(m.hips)), 0.68, 0.06))
