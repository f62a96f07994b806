"""Corrections of clips that are unsuitable for training: gaits on the spot, and clips of up to 1.5 seconds.

A gait on the spot gets the travel implied by its standing feet. A short closed cycle is repeated. Any other short clip
is not looped: it gets a piece of a captured idle before and after it, with inertialized transitions.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.data.captions import seeded
from marey.data.part import FPS
from marey.data.splice import join_clips, seam_costs, seam_features
from marey.motion.support import RADII
from marey.posing.limbs import LEVEL

Array = NDArray[np.floating]

SHORT = 30
"""Frames up to which a clip is lengthened (1.5 seconds)."""
LEAST_STANCE = 0.3
CYCLE_FRAMES = 50  # least length of repeated cycles
_CLOSES = 0.03  # metres, mean over joints, between the last pose and the first
_STANDS = 0.03  # metres above the floor
_CARRIERS = (10, 11, 7, 8, 4, 5, 20, 21)  # toes, ankles, knees, wrists
_IDLE_FRAMES = (10, 24)
_HELD_FRAMES = 8  # frames of the first pose for the transition from the idle, so that the action stays as captured
_WORST_SEAM = 0.25  # see `splice.seam_costs`


def travelling(joints: Array) -> Array | None:
    """Add the constant travel to a gait on the spot (T, 22, 3) that keeps standing joints in place; None if no joint
    stands for `LEAST_STANCE` of the frames, as in a run in the air."""
    joints = np.asarray(joints, np.float64)
    height = joints[:, _CARRIERS, 1] - RADII[list(_CARRIERS)]
    lowest = height.argmin(axis=1)
    stands = (height.min(axis=1) < _STANDS)[:-1] & (lowest[1:] == lowest[:-1])
    if stands.mean() < LEAST_STANCE:
        return None
    rows = np.flatnonzero(stands)
    carriers = np.array(_CARRIERS)[lowest[rows]]
    steps = (joints[rows + 1, carriers] - joints[rows, carriers])[:, [0, 2]]
    step = np.median(steps, axis=0)
    out = joints.copy()
    out[..., [0, 2]] -= step * np.arange(len(joints))[:, None, None]
    return out


def closes(joints: Array) -> bool:
    """Return True if the clip is a closed cycle: apart from travel, its last and first poses are equal or differ by no
    more than adjacent frames."""
    local = joints - joints[:, :1] * LEVEL
    step = np.median(np.linalg.norm(np.diff(local, axis=0), axis=-1).mean(-1))
    return _gap(joints) < max(_CLOSES, float(step))


def repeated(joints: Array, frames: int = CYCLE_FRAMES) -> Array:
    """Repeat a closed cycle until it has at least `frames` frames; each repetition continues where the last one
    ended."""
    if _gap(joints) >= _CLOSES:  # the last pose precedes the first by a frame
        step = (joints[-1, 0] - joints[0, 0]) * LEVEL / (len(joints) - 1)
        joints = np.concatenate([joints, joints[:1] + step * len(joints)])
    advance = (joints[-1, 0] - joints[0, 0]) * LEVEL
    rounds = max(1, -(-(frames - 1) // (len(joints) - 1)))
    pieces = [joints[:-1] + k * advance for k in range(rounds)]
    return np.concatenate([*pieces, joints[-1:] + (rounds - 1) * advance])


def _gap(joints: Array) -> float:
    """Distance between the first and last poses apart from travel, mean over joints, metres."""
    local = joints - joints[:, :1] * LEVEL
    return float(np.linalg.norm(local[-1] - local[0], axis=-1).mean())


def between_idles(joints: Array, idles: Sequence[Array], seed: str) -> Array | None:
    """Add captured idle before and after a short clip, at each end where an idle has a similar pose; None if neither
    end has one."""
    rng = seeded("idle", seed)
    out = np.asarray(joints, np.float64)
    before = _piece(out[:2], idles, rng.randint(*_IDLE_FRAMES), at_end=True)
    if before is not None:
        out = join_clips(before, np.concatenate([np.repeat(out[:1], _HELD_FRAMES, axis=0), out]), FPS)
    after = _piece(out[-2:], idles, rng.randint(*_IDLE_FRAMES), at_end=False)
    if after is not None:
        out = join_clips(out, after, FPS)
    return None if before is None and after is None else out


def _piece(pose: Array, idles: Sequence[Array], frames: int, *, at_end: bool) -> Array | None:
    """Take frames of the idle that best fits a pose (2, 22, 3), ending (`at_end`) or beginning with it; or None."""
    best, least = None, _WORST_SEAM
    here = seam_features(pose, FPS)[:1]
    for idle in idles:
        room = range(frames, len(idle)) if at_end else range(len(idle) - frames)
        if len(room) == 0:
            continue
        costs = seam_costs(here, seam_features(np.asarray(idle, np.float64), FPS))[0, list(room)]
        if costs.min() < least:
            least, at = float(costs.min()), room[int(costs.argmin())]
            best = idle[at - frames : at + 1] if at_end else idle[at : at + frames + 1]
    return None if best is None else np.asarray(best, np.float64)
