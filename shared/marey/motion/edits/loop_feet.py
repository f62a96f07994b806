"""Steps of a gait: which foot carries the body, and since when."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.feet import FLOOR_BAND, runs
from marey.motion.filters import smooth
from marey.motion.rotations import Array
from marey.motion.skeleton import Skeleton

Bool = NDArray[np.bool_]

RUNS = 1.5
"""Metres a second of the root from which on feet are told by their speed beside the body's: at 20 frames a second the
foot of a runner stands for two or three frames, and contacts, which ask for a still foot, miss one of two."""
CARRIES = 0.5
"""Largest speed of a carrying toe over that of the root."""
LOW = 0.08
"""Largest height of a carrying toe over its lowest, metres."""
SPOT = 0.1
"""Metres within which the root of a body stays that walks on the spot, as on a treadmill."""
STILL = 0.25
"""Share of the frames in which a foot of such a body stands at most: it is still where it turns back, for a frame."""


def supports(joints: Array, contacts: Bool, skeleton: Skeleton, fps: float) -> Bool:
    """Return where each foot (T, 2), left and right, carries the body: it stands, it hardly moves under a body that
    runs, or it slides back under one that walks on the spot.

    Args:
        joints: (T, J, 3) metres.
        contacts: (T, 4).
    """
    joints = np.asarray(joints, np.float64)
    found = stands(contacts)
    if len(joints) < 2:
        return found
    root = smooth(np.gradient(joints[:, 0], axis=0)[:, [0, 2]] * fps, 0.15 * fps)
    pace = np.linalg.norm(root, axis=-1)
    for side, toe in enumerate(skeleton.feet[1::2]):
        place = joints[:, toe]
        speed = np.linalg.norm(np.gradient(place, axis=0)[:, [0, 2]], axis=-1) * fps
        low = place[:, 1] < np.quantile(place[:, 1], 0.02) + LOW
        found[:, side] |= (pace > RUNS) & (speed < CARRIES * pace) & low
    return found | on_the_spot(joints, contacts, skeleton)


def on_the_spot(joints: Array, contacts: Bool, skeleton: Skeleton) -> Bool:
    """Return where the feet (T, 2) carry a body that walks on the spot: the lower one, if the body stays at its place,
    both feet come near the floor in turn, and hardly one ever stands still; else nowhere.

    Clips of games are made so: the root stays, and the feet move against the floor all the time.
    """
    joints = np.asarray(joints, np.float64)
    none = np.zeros((len(joints), 2), bool)
    toes = joints[:, list(skeleton.feet[1::2])]
    if stands(contacts).any(axis=1).mean() > STILL or np.ptp(joints[:, 0, [0, 2]], axis=0).max() > SPOT:
        return none
    near = toes[..., 1] < min(toes[..., 1].min(), FLOOR_BAND[1]) + LOW
    alone = near & ~near[:, ::-1]
    return near if alone.any(axis=0).all() else none


def stands(contacts: Bool) -> Bool:
    """Return where each foot (T, 2), left and right, stands on ankle or toe."""
    return np.stack([contacts[:, :2].any(axis=1), contacts[:, 2:].any(axis=1)], axis=1)


def onsets(feet: Bool) -> Bool:
    """Return the frames (T, 2) in which a foot begins to stand; never the first one."""
    return np.concatenate([np.zeros((1, 2), bool), feet[1:] & ~feet[:-1]])


def standing_spans(feet: Bool) -> list[tuple[int, int, int]]:
    """Return (begin, end, foot) of each stand of feet (T, 2), in order of time; the end is exclusive."""
    return sorted((begin, end, foot) for foot in range(2) for begin, end in runs(feet[:, foot]))
