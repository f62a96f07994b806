"""Joints along a limb that share its twist, so that skin does not wring at one place."""

from __future__ import annotations

import numpy as np

from marey.motion.rigs.body import RigBody
from marey.motion.rotations import Array, conjugate, dot, from_rotvec, multiply, normalize


def share_twists(target: RigBody, turned: Array) -> None:
    """Turn twist joints about their bones, in place.

    The upper bone of a limb is turned about itself by its beginning, and skin near the shoulder or hip shall not be;
    the lower bone is turned by the hand or foot at its end. No end of a bone moves, for each turn is about its line.

    Args:
        turned: (T, J, 4) of all joints from the upright rest pose, in the world.
    """
    rig, parts = target.rig, target.map.parts
    bones = sorted({twist.bone for twist in target.map.twists.values()})
    for bone in bones:
        begin, end = (parts[name] for name in bone)
        joints = {joint: twist for joint, twist in target.map.twists.items() if twist.bone == bone}
        axis = normalize(target.places[end] - target.places[begin])
        upper = bone[0].endswith(("upper_arm", "upper_leg"))
        base = turned[:, begin].copy()
        if upper:
            parent = turned[:, rig.parents[begin]]
            angle = twist_angle(multiply(conjugate(parent), base), axis)
        else:
            angle = twist_angle(multiply(conjugate(base), turned[:, end]), axis)
        inline = sorted((joint for joint, twist in joints.items() if twist.inline), key=lambda j: joints[j].share)
        ends = [*(joints[joint].share for joint in inline), 1.0]
        for number, joint in enumerate([begin, *inline] if inline else []):
            share = (ends[number - 1] if number else 0.0) / 2 + ends[number] / 2
            turned[:, joint] = _twisted(base, axis, angle * (share - 1.0 if upper else share))
        for joint, twist in joints.items():
            if not twist.inline:
                turned[:, joint] = _twisted(base, axis, angle * (twist.share - 1.0 if upper else twist.share))


def twist_angle(turn: Array, axis: Array) -> Array:
    """Return the angle (T,) in radians by which rotations (T, 4) turn about an axis (3,), without jumps in time."""
    sine = dot(turn[:, 1:], np.broadcast_to(axis, (len(turn), 3)))
    return np.unwrap(2 * np.arctan2(sine, turn[:, 0]))


def _twisted(base: Array, axis: Array, angle: Array) -> Array:
    """Return turns (T, 4), each turned first about an axis (3,) of the rest pose."""
    return multiply(base, from_rotvec(angle[:, None] * axis))
