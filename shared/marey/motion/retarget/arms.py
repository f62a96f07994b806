"""Hands that reach where the source's hands are, on request."""

from __future__ import annotations

import numpy as np

from marey.motion.legs import two_bone_knee
from marey.motion.retarget.legs import Stance
from marey.motion.retarget.posed import PosedRig
from marey.motion.retarget.source import Source
from marey.motion.rigs.parts import SIDES
from marey.motion.rotations import Array, between, length, multiply, normalize


def reach_hands(source: Source, stance: Stance, posed: PosedRig, hips: Array) -> None:
    """Turn the arms of a pose until the hands are where the source's hands are: at the scale of the legs, from the
    middle of the hips. A hand that is out of reach comes as near as it can.

    Args:
        hips: (T, 3) the middle between the hip joints of the target, metres.
    """
    theirs = (source.places("left_upper_leg") + source.places("right_upper_leg")) / 2
    _, places = posed.spread()
    parts = posed.target.map.parts
    for side in SIDES:
        names = [f"{side}_{part}" for part in ("upper_arm", "lower_arm", "hand")]
        if not all(source.body.has(name) and posed.target.has(name) for name in names):
            continue
        arm = places[:, [parts[name] for name in names]]
        goal = hips + stance.scale * (source.places(names[2]) - theirs)
        across = goal - arm[:, 0]
        reach = 0.995 * length(arm[:, 1:] - arm[:, :-1]).sum(axis=1)
        goal = arm[:, 0] + normalize(across) * np.minimum(length(across), reach)[:, None]
        bend = arm[:, 1] - (arm[:, 0] + arm[:, 2]) / 2
        elbow = two_bone_knee(arm, arm[:, 0], goal, normalize(bend))
        for name, was, now in (
            (names[0], arm[:, 1] - arm[:, 0], elbow - arm[:, 0]),
            (names[1], arm[:, 2] - arm[:, 1], goal - elbow),
        ):
            posed.turns[name] = multiply(between(was, now), posed.turns[name])
