"""Waves: a lifted forearm that swings about a still elbow.

A network lifts the hand, but it often swings the whole arm, or holds the hand still where its tokenizer lost the swing.
Where the hand is up the elbow is brought to rest, and a swing that is missing is drawn as in the made clips of the
training data.
"""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ELBOWS, PELVIS, SHOULDERS, WRISTS, velocity
from marey.generation.fine_wish import FineWish
from marey.motion.feet import runs
from marey.motion.filters import smooth, smoothstep
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, from_rotvec, rotate
from marey.motion.skeleton import HUMANML3D
from marey.selector.motion import UP, Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import is_shown

LEAST_S = 0.8
"""Seconds for which a hand is up at least that waves."""
ELBOW_MOVES = 0.4
"""Median speed of the elbow, as a share of that of the wrist, from which on the whole arm swings."""
EDGE_S = 0.35
"""Seconds in which an arm passes into the wave, and out of it."""
CALM_S = 0.3
"""Standard deviation of the filter that leaves an arm's way and takes out its swing, seconds."""
DEGREES, HZ = (18.0, 30.0), (1.6, 2.3)
"""To each side, and swings a second, of a swing that is drawn."""


def waves_well(joints: Array, fps: float, wish: FineWish) -> bool:
    """Return True if a waving arm swings about its elbow."""
    del wish
    shares = (_elbow_share(joints, fps, k, begin, end) for k in (0, 1) for begin, end in _lifted(joints, fps, k))
    return max(shares, default=0.0) <= ELBOW_MOVES


def waved(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints whose lifted hands wave, `count` times or on and on; None if no hand is up for long."""
    spans = [(k, *span) for k in (0, 1) for span in _lifted(joints, fps, k)]
    if not spans:
        return None
    motion, count = Motion(joints, fps), wish.count
    draws = not is_shown(motion, "wave") if count is None else len(REPETITIONS["wave"](motion)) != count
    longest = max(end - begin for _, begin, end in spans)
    rate, degrees = rng.uniform(*HZ), rng.uniform(*DEGREES)
    moved = joints.copy()
    for k, begin, end in spans:
        strength = _strength(begin, end, len(joints), fps)
        swing = None
        if draws and end - begin >= 0.6 * longest:
            swing = degrees * _swing(strength, begin, rate / fps, count)
        _still_elbow(moved, k, strength, swing, fps)
    return moved


def _lifted(joints: Array, fps: float, k: int) -> list[tuple[int, int]]:
    """Return the spans of frames in which a hand (0 = left) is up for long."""
    up = joints[:, WRISTS[k], 1] - joints[:, SHOULDERS[k], 1] > UP
    return [(begin, end) for begin, end in runs(up) if end - begin >= LEAST_S * fps]


def _elbow_share(joints: Array, fps: float, k: int, begin: int, end: int) -> float:
    part = joints[begin:end] - joints[begin:end, [PELVIS]]
    elbow, wrist = (np.median(np.linalg.norm(velocity(part[:, each], fps), axis=-1)) for each in (ELBOWS[k], WRISTS[k]))
    return float(elbow / max(wrist, 1e-6))


def _strength(begin: int, end: int, frames: int, fps: float) -> Array:
    """Return 0 to 1 (T,): how much of a wave there is; a motion that begins or ends with the hand up has it in full."""
    time, edge = np.arange(frames), EDGE_S * fps
    after = (time - begin) / edge if begin > 0 else np.ones(frames)
    before = (end - 1 - time) / edge if end < frames else np.ones(frames)
    return smoothstep(np.clip(np.minimum(after, before), 0.0, 1.0))


def _swing(strength: Array, begin: int, rate: float, count: int | None) -> Array:
    """Return -1 to 1 (T,): where between its sides the forearm is.

    Args:
        strength: (T,).
        begin: first frame of the wave.
        rate: swings a frame; a number that does not fit is done faster.
        count: of swings; None = as many as fit.
    """
    whole = np.flatnonzero(strength > 0.5)
    if count is None:
        return strength * np.sin(2 * np.pi * rate * np.arange(-begin, len(strength) - begin))
    rate = max(rate, count / max(len(whole) - 1, 1))
    first = whole[0] + max(len(whole) - 1 - count / rate, 0.0) / 2
    turns = rate * (np.arange(len(strength)) - first)
    return np.where((turns > 0) & (turns < count), np.sin(2 * np.pi * turns), 0.0)


def _still_elbow(joints: Array, k: int, strength: Array, swing: Array | None, fps: float) -> None:
    """Take the swing out of an upper arm, and out of the forearm too where another `swing` in degrees (T,) is drawn."""
    upper = joints[:, ELBOWS[k]] - joints[:, SHOULDERS[k]]
    fore = joints[:, WRISTS[k]] - joints[:, ELBOWS[k]]
    elbow = joints[:, SHOULDERS[k]] + _calmed(upper, strength, fps)
    if swing is None:
        wrist = _as_long(joints[:, WRISTS[k]] - elbow, fore)
    else:
        calm = _calmed(fore, strength, fps)
        wrist = rotate(from_rotvec(np.radians(swing)[:, None] * _axis(joints, calm, fps)), calm)
    joints[:, ELBOWS[k]], joints[:, WRISTS[k]] = elbow, elbow + wrist


def _calmed(bones: Array, strength: Array, fps: float) -> Array:
    """Return vectors (T, 3) of the same length that go on their way without swinging."""
    return _as_long(bones + strength[:, None] * (smooth(bones, CALM_S * fps) - bones), bones)


def _as_long(vectors: Array, bones: Array) -> Array:
    """Return vectors (T, 3) with the lengths of others."""
    return vectors * (np.linalg.norm(bones, axis=-1) / np.maximum(np.linalg.norm(vectors, axis=-1), 1e-6))[:, None]


def _axis(joints: Array, fore: Array, fps: float) -> Array:
    """Return the axis (T, 3) about which a forearm swings from side to side: the way the body faces for one that points
    up, the vertical for one that points ahead."""
    forward = smooth(facing(joints, HUMANML3D), 0.2 * fps)
    left = np.stack([forward[:, 2], np.zeros(len(joints)), -forward[:, 0]], axis=1)
    axis = np.cross(left, fore)
    aside = np.linalg.norm(axis, axis=-1, keepdims=True) < 0.3 * np.linalg.norm(fore, axis=-1, keepdims=True)
    axis = smooth(np.where(aside, forward, axis), 0.2 * fps)
    return axis / np.maximum(np.linalg.norm(axis, axis=-1, keepdims=True), 1e-6)
