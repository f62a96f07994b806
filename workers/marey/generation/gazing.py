"""Heads that turn where the prompt has them look.

The features of a motion hold the places of its joints; which way a head faces does not show in them, so no network
learned it. The turn is drawn on the rotations of neck and head.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.filters import smooth
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array, from_rotvec, multiply

GAZE = "gaze"
"""Key of a manifest, and of the record of a row of a timeline."""
SHARES = {"neck": 0.45, "head": 0.55}
"""How much of a turn of the head each joint takes."""
TRUNK = ("spine1", "spine2", "spine3")
"""Joints that turn evenly with a body that looks behind itself."""
DEGREES: Mapping[str, tuple[float, float, float]] = {
    "left": (55, 0, 0),
    "right": (-55, 0, 0),
    "up": (0, -28, 0),
    "down": (0, 32, 0),
    "ahead": (0, 0, 0),
    "behind_left": (70, 4, 48),
    "behind_right": (-70, 4, -48),
}
"""Of the head to the left and down, and of the trunk to the left."""
PASSES_S = 0.13
"""Standard deviation of the filter that makes a turn of the head smooth, seconds."""
BEHIND_S = 0.17
"""The same where the trunk turns too."""
EDGE_S = 0.3
"""Seconds at both ends in which the head faces ahead."""
SHAKES, SHAKE_DEGREES, SHAKE_HZ, PAUSE_S = 3, 27.0, 1.5, 0.8
"""Swings of a row of head shakes, their size to each side, swings a second, and seconds between rows."""


def with_gaze(clip: MotionClip) -> MotionClip:
    """Return the clip with the head turned as its manifest, and that of each row of a timeline, says."""
    names = clip.skeleton.joint_names
    if not set(SHARES) <= set(names):
        return clip
    turns = np.zeros((clip.frames, 3))
    for begin, end, glances, seed in _spans(clip):
        turns[begin:end] += _turns(glances, end - begin, clip.fps, np.random.default_rng([seed, len(glances)]))
    if not turns.any():
        return clip
    rotations = clip.rotations.astype(np.float64)
    for name in TRUNK:
        twist = from_rotvec(np.radians(turns[:, 2] / len(TRUNK))[:, None] * [0.0, 1.0, 0.0])
        rotations[:, names.index(name)] = multiply(twist, rotations[:, names.index(name)])
    for name, share in SHARES.items():
        joint = names.index(name)
        yaw, pitch = (np.radians(share * turns[:, k])[:, None] for k in (0, 1))
        turned = multiply(from_rotvec(yaw * [0.0, 1.0, 0.0]), from_rotvec(pitch * [1.0, 0.0, 0.0]))
        rotations[:, joint] = multiply(turned, rotations[:, joint])
    joints = forward_kinematics(clip.skeleton, rotations, clip.root).astype(np.float32)
    return replace(clip, rotations=rotations.astype(np.float32), joints=joints)


def _spans(clip: MotionClip) -> Iterator[tuple[int, int, Sequence[str], int]]:
    """Yield first and last frame of each gaze, its glances, and the seed."""
    manifest: Mapping[str, Any] = clip.manifest
    if manifest.get(GAZE):
        yield 0, clip.frames, manifest[GAZE], int(manifest.get("seed", 0))
    for row in manifest.get("timeline", {}).get("rows", ()):
        if row.get(GAZE):
            end = min(round(row["end"] * clip.fps), clip.frames)
            yield round(row["start"] * clip.fps), end, row[GAZE], int(row["seed"])


def _turns(glances: Sequence[str], frames: int, fps: float, rng: np.random.Generator) -> Array:
    """Return degrees (T, 3) of the head to the left and down, and of the trunk to the left."""
    first, second = rng.permutation(["left", "right"]).tolist()
    twice = {f"twice_{side}": (side, "ahead", side) for side in (first, second)}
    several = {"around": (first, second), "behind": (f"behind_{first}",), "twice": twice[f"twice_{first}"], **twice}
    ways = [way for glance in glances for way in several.get(glance, (glance,))]
    edge = round(EDGE_S * fps)
    bounds = np.linspace(edge, max(frames - edge, edge), len(ways) + 1).round().astype(int)
    turns, shaken = np.zeros((frames, 3)), np.zeros((frames, 3))
    for way, begin, end in zip(ways, bounds, bounds[1:], strict=False):
        if way == "shake":
            shaken[begin:end, 0] = _shaken(end - begin, fps)
        else:
            turns[begin:end] = np.array(DEGREES[way]) * rng.uniform(0.85, 1.1)
    # The filter would leave a third of the shakes.
    return smooth(turns, (BEHIND_S if turns[:, 2].any() else PASSES_S) * fps) + shaken


def _shaken(frames: int, fps: float) -> Array:
    """Return degrees (T,) to the left of a head that is shaken, in rows."""
    time, row = np.arange(frames) / fps, SHAKES / SHAKE_HZ
    within = time % (row + PAUSE_S)
    last = frames / fps // (row + PAUSE_S) * (row + PAUSE_S)
    whole = (time < last) | (frames / fps - last >= row)
    swing = np.sin(2 * np.pi * SHAKE_HZ * within) * np.sin(np.pi * np.clip(within / row, 0, 1)) ** 0.5
    return SHAKE_DEGREES * swing * (within < row) * whole
