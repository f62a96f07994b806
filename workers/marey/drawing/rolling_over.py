"""Bodies that lie and roll over on the floor: from the back onto the front, back again, or from a side.

The body turns about its own length, with the limbs close to it, and is as high as it has to be so that nothing goes
through the floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES
from marey.motion.filters import smooth
from marey.motion.rotations import about, cross, from_rotvec, normalize, rotate
from marey.posing.bones import directions_of
from marey.posing.limbs import BONE_LENGTHS, FPS, LEVEL, PARENTS
from marey.posing.standing import ARMS, LEGS, NECK, SIGN, eased

Array = NDArray[np.floating]

HALF_S, WHOLE_S = 1.5, 1.1
"""Seconds of half a turn, and of each further one."""
STARTS, CLOSES = 0.1, 0.38
"""Shares of that time after which a body begins to turn, and has its limbs close to it."""
ROLLS_M = 0.4
"""Metres by which a body rolls aside in half a turn."""
ROOM_M = 0.02
"""Metres by which a body on its side lies higher, over its shoulder."""
_PELVIS = 0
_LENGTH_M, _TILT, _SETTLES = 1.1, 0.18, 8
"""Metres between the shoulders and the shanks of a body that lies, radians by which it is tilted at most, and frames at
both ends in which it comes to that."""
_UPPER, _FORE, _LEG = (-0.1, -0.8, 0.5), (-0.7, 0.5, 0.5), (0.06, -1.0, 0.03)
"""Directions of an arm and a leg that are kept close to a body which turns: outward, towards the head, forward."""


def rolled_over(first: Array, second: Array, side: str = "", halves: int = 1) -> Array:
    """Return joints (T, 22, 3) of a body that lies in a pose and rolls over into another one.

    Args:
        first: (22, 3) the pose at the beginning.
        second: (22, 3) the other one, wherever it lies.
        side: left or right, to which it rolls; empty = the shorter way.
        halves: half turns, where both poses lie on opposite sides, or on the same.
    """
    along, ahead = _axes(first)
    second = _pointed(second, along)
    turned = float(np.degrees(np.arctan2(cross(ahead, _axes(second)[1]) @ along, ahead @ _axes(second)[1])))
    degrees = _degrees(turned, side, halves)
    seconds = max(HALF_S * min(abs(degrees) / 180.0, 1.0), 0.8) + WHOLE_S * max(abs(degrees) / 180.0 - 1.0, 0.0)
    time = np.linspace(0.0, 1.0, round(seconds * FPS) + 1)
    share, near = eased((time - STARTS) / (1 - 2 * STARTS)), eased(time / CLOSES) * eased((1 - time) / CLOSES)
    ends = first - first[_PELVIS], _unrolled(second - second[_PELVIS], along, degrees)
    poses = _limbs(ends, _close(ends[0], along, ahead), share, near)
    turns = np.radians(degrees) * share[:, None] * along
    flat = 0.0 if abs(turned) > 120.0 or abs(turned) < 60.0 else np.radians(90.0)  # who lies on a side begins there
    between = np.abs(np.sin(np.radians(degrees) * share + flat))
    joints = _level(rotate(from_rotvec(turns)[:, None], poses), along, between)
    way = normalize(np.cross(along, [0.0, 1.0, 0.0])) * -np.sign(degrees)
    place = first[_PELVIS] * LEVEL + share[:, None] * way * ROLLS_M * abs(degrees) / 180.0
    lowest = [pose[:, 1].min() for pose in (first, second)]
    floor = (1 - share) * lowest[0] + share * lowest[1] + ROOM_M * between
    place[:, 1] = smooth((floor - joints[..., 1].min(1))[:, None], 1.0)[:, 0]
    return joints + place[:, None]


def _level(joints: Array, along: Array, aside: Array) -> Array:
    """Return poses (T, 22, 3) tilted so that shoulders and legs come to the floor together: a body on its side, by
    `aside` (T,), is wider at its shoulders."""
    legs = [joint for leg in LEGS.values() for joint in leg]
    upper = [joint for joint in range(joints.shape[1]) if joint not in legs and joint != _PELVIS]
    apart = joints[:, legs, 1].min(1) - joints[:, upper, 1].min(1)
    tilt = np.clip(smooth(apart[:, None], 1.5)[:, 0] / _LENGTH_M, -_TILT, _TILT)
    still = np.minimum(np.arange(len(tilt)), np.arange(len(tilt))[::-1]) / _SETTLES
    axis = np.cross(along, [0.0, 1.0, 0.0])
    return rotate(from_rotvec((eased(still) * aside * tilt)[:, None] * axis)[:, None], joints)


def _axes(pose: Array) -> tuple[Array, Array]:
    """Return the length of a body that lies, on the level, towards its head, and where its front points."""
    along = normalize((pose[NECK] - pose[_PELVIS]) * LEVEL)
    across = pose[LEGS["left"][0]] - pose[LEGS["right"][0]]
    ahead = cross(across, pose[NECK] - pose[_PELVIS])
    return along, normalize(ahead - along * (ahead @ along))


def _pointed(pose: Array, along: Array) -> Array:
    """Return a pose turned about the vertical until its head points along."""
    now = _axes(pose)[0]
    return rotate(about("Y", np.arctan2(now[2] * along[0] - now[0] * along[2], now @ along)), pose)


def _degrees(turned: float, side: str, halves: int) -> float:
    """Return the degrees by which a body turns about its length: positive to its left."""
    over = abs(turned) > 90.0
    if not over and halves > 1:
        sign = -1.0 if side == SIDES[1] else 1.0
        return turned + sign * 360.0 * max(round(halves / 2), 1)
    if abs(turned) < 120.0:
        return turned
    sign = SIGN[side] if side else (1.0 if turned > 0 else -1.0)
    return (turned if turned * sign > 0 else turned + sign * 360.0) + sign * 360.0 * ((halves - 1) // 2)


def _unrolled(pose: Array, along: Array, degrees: float) -> Array:
    return rotate(from_rotvec(-np.radians(degrees) * along), pose)


def _limbs(ends: tuple[Array, Array], close: Array, share: Array, near: Array) -> Array:
    """Return poses (T, 22, 3) about the pelvis, not yet turned: the limbs go from one pose to the other by `share`, and
    to those of a body with its limbs close by `near`."""
    first, second, tucked = (directions_of(pose[None]) for pose in (*ends, close))
    share, near = share[:, None, None], near[:, None, None]
    bones = normalize((1 - near) * ((1 - share) * first + share * second) + near * tucked)
    joints = np.zeros((len(share), *close.shape))
    for joint in range(1, len(PARENTS)):
        joints[:, joint] = joints[:, PARENTS[joint]] + BONE_LENGTHS[joint] * bones[:, joint]
    return joints


def _close(pose: Array, along: Array, ahead: Array) -> Array:
    """Return a pose with straight legs and the arms before the chest."""
    left, found = cross(along, ahead), pose.copy()
    for side in SIDES:
        axes = np.stack([SIGN[side] * left, along, ahead])
        _, shoulder, elbow, wrist = ARMS[side]
        hip, knee, ankle, _ = LEGS[side]
        for bones, direction in (
            (((shoulder, elbow),), _UPPER),
            (((elbow, wrist),), _FORE),
            (((hip, knee), (knee, ankle)), _LEG),
        ):
            for begin, end in bones:
                moved = found[begin] + BONE_LENGTHS[end] * (normalize(np.array(direction)) @ axes)
                found[_below(end)] += moved - found[end]
    return found


def _below(joint: int) -> list[int]:
    """Return a joint and those that hang on it."""
    found = [joint]
    for other in range(joint + 1, len(PARENTS)):
        if PARENTS[other] in found:
            found.append(other)
    return found
