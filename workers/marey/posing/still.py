"""A body that stands and waits, for movements of the whole body that begin or end so."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import normalize
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import BONE_LENGTHS, FPS, PARENTS
from marey.posing.standing import ARMS, LEGS, SIGN, StandingBody, direction

Array = NDArray[np.floating]

_ANKLE, _TOE = 0.075, 0.015
"""Metres of a foot that stands, over the floor."""
_APART, _TURNED = 0.105, 9.0
"""Metres of the ankles from the middle, and degrees by which the feet point outward: the same of all bodies, so that
the feet of one that stands between two movements need not shuffle."""
_BEHIND = -0.035
"""Metres of the ankles before the hips: the weight is over the middle of the feet."""
_BENT = 0.994
"""Share of the length of a straight leg between hip and ankle."""
_UPPER, _FORE = ((6.0, 16.0), (-4.0, 8.0)), ((8.0, 22.0), (6.0, 18.0))
"""Degrees by which an arm that hangs is turned outward and forward."""
_BREATHS_HZ, _SWAYS_HZ = (0.22, 0.3), (0.14, 0.22)
_SWAY = {"left": 0.008, "forward": 0.006, "up": 0.0025}
"""Metres by which a body that stands sways and breathes."""
_ARM_SWINGS = {"upper": 0.8, "fore": 2.2}
"""Degrees by which the bones of arms that hang swing to and fro meanwhile, each arm in its own time."""


def standing_still(frames: int, rng: random.Random) -> Array:
    """Joints (T, 22, 3) of a body that stands on the origin and faces +Z, with its breath and its sway; metres."""
    body = StandingBody(np.repeat(_upright()[None], frames, axis=0))
    time = np.arange(frames) / FPS
    for side in ARMS:
        (out, ahead), (fore_out, fore_ahead) = ((rng.uniform(*limits) for limits in bone) for bone in (_UPPER, _FORE))
        swing = np.sin(2 * np.pi * (rng.uniform(*_SWAYS_HZ) * time + rng.random()))
        ahead, fore_ahead = ahead + _ARM_SWINGS["upper"] * swing, fore_ahead + _ARM_SWINGS["fore"] * swing
        ways = _hanging(out, ahead), _hanging(0.3 * fore_out, ahead + fore_ahead)
        body.move_arm(side, np.ones(frames), *ways, 0.0, straight=True)
    breath, sway = (np.sin(2 * np.pi * (rng.uniform(*rate) * time + rng.random())) for rate in (_BREATHS_HZ, _SWAYS_HZ))
    aside = np.sin(2 * np.pi * (rng.uniform(*_SWAYS_HZ) * time + rng.random()))
    body.shift(_SWAY["up"] * (breath - 1), _SWAY["forward"] * sway, _SWAY["left"] * aside)
    body.lean(0.8 * breath, "left")
    return body.solved()


def _hanging(out: float, ahead: Array) -> Array:
    """Directions (T, 3) of an arm, outward, up and forward, by degrees outward and (T,) forward."""
    sideways, down = np.full_like(ahead, np.tan(np.radians(out))), np.full_like(ahead, -1.0)
    return normalize(np.stack([sideways, down, np.tan(np.radians(ahead))], axis=-1))


def _upright() -> Array:
    """Joints (22, 3) of a body with feet on the floor and arms as in the skeleton's rest."""
    joints = np.zeros((len(PARENTS), 3))
    for joint, parent in enumerate(PARENTS):
        if joint:
            joints[joint] = joints[parent] + HUMANML3D.offsets[joint]
    legs = list(LEGS.values())
    length = BONE_LENGTHS[legs[0][1]] + BONE_LENGTHS[legs[0][2]]
    middle = 0.5 * (joints[legs[0][0]] + joints[legs[1][0]])
    aside = _APART - abs(joints[legs[0][0], 0] - middle[0])
    height = _ANKLE + np.sqrt((_BENT * length) ** 2 - aside**2)
    joints += np.array([-middle[0], height - middle[1], -middle[2]])
    for side, (hip, knee, ankle, toe) in LEGS.items():
        joints[ankle] = SIGN[side] * _APART, _ANKLE, _BEHIND
        joints[knee] = 0.5 * (joints[hip] + joints[ankle]) + np.array([0.0, 0.0, 0.04])
        way = direction(SIGN[side] * _TURNED, 0.0)
        level = np.sqrt(BONE_LENGTHS[toe] ** 2 - (_ANKLE - _TOE) ** 2)
        joints[toe] = joints[ankle] + level * way - np.array([0.0, _ANKLE - _TOE, 0.0])
    return joints
