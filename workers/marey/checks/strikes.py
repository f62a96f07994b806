"""Kicks, punches, slashes and dancing on joints. One to five real takes show each, so thresholds are wide."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, PELVIS, SHOULDERS, WRISTS, Array, body_frame, heading, velocity
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds

Interval = tuple[int, int]


def kicks(joints: Array, fps: float) -> list[Interval]:
    """Frames with an ankle at hip height or nearly (a run lifts it to 0.25 m under the pelvis, folded back)."""
    out: list[Interval] = []
    angle = heading(joints, fps)
    for ankle in ANKLES:
        over = joints[:, ankle, 1] - joints[:, PELVIS, 1]
        forward, left = body_frame(joints[:, ankle] - joints[:, PELVIS], angle)
        out += runs((over > -0.35) & (np.hypot(forward, left) > 0.35) & ((forward > 0) | (np.abs(left) > 0.35)))
    return sorted(out)


def punches(joints: Array, fps: float) -> list[Interval]:
    """Frames in which a fist shoots forward, 1.3 m/s and more from the shoulder, at about shoulder height."""
    angle = heading(joints, fps)
    out: list[Interval] = []
    for wrist, shoulder in zip(WRISTS, SHOULDERS, strict=True):
        reach = smooth_seconds(joints[:, wrist] - joints[:, shoulder], 0.03, fps)
        forward, _ = body_frame(reach, angle)
        speed = velocity(forward, fps)
        level = (np.abs(reach[:, 1]) < 0.3) & (np.abs(velocity(reach[:, 1], fps)) < 0.6 * speed)
        fast = (speed > 1.2) & (forward > 0.15) & level
        out += runs(fast)
    return sorted(out)


def slashes(joints: Array, fps: float) -> list[Interval]:
    """Slashes: from both hands together over the head to their fast way down, at 1.2 m/s or more."""
    hands = joints[:, list(WRISTS)].mean(axis=1)
    over = smooth_seconds(hands[:, 1] - joints[:, HEAD, 1], 0.03, fps)
    apart = np.linalg.norm(joints[:, WRISTS[0]] - joints[:, WRISTS[1]], axis=-1)
    down = velocity(smooth_seconds(hands[:, 1], 0.03, fps), fps) < -1.2
    window = round(0.6 * fps)
    out: list[Interval] = []
    for a, b in runs((over > -0.05) & (apart < 0.2)):
        after = np.flatnonzero(down[a : b + window])
        if len(after):
            out.append((a, a + int(after[-1]) + 1))
    return out


def liveliness(joints: Array, fps: float) -> Array:
    """(T,) mean speed of the joints relative to the pelvis, metres a second, smoothed over half a second."""
    local = joints - joints[:, :1]
    return smooth_seconds(np.linalg.norm(velocity(local, fps), axis=-1).mean(axis=1), 0.5, fps)


def is_lively(joints: Array, fps: float) -> bool:
    """Return True if the limbs move for at least 40 % of the time."""
    return bool(np.mean(liveliness(joints, fps) > 0.3) >= 0.4)
