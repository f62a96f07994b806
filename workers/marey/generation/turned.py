"""Motions that turn as far as their prompt asks.

A network learned that an action turns, but hardly how far: "turns around" ends after a turn of 300 degrees. A turn on
the spot that is much too large ends with both feet on the floor as soon as it is large enough: made smaller, it would
drag its feet through too many steps. Else the turn of a motion is made larger or smaller all along it, as its path is
bent to a constraint (Gleicher 2001): standing feet stay, and steps take up the difference.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marey.motion.bones import bone_fit
from marey.motion.courses import Course, bent, natural_course
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.feet import find_contacts
from marey.motion.filters import smoothstep
from marey.motion.kinematics import forward_kinematics
from marey.motion.pose import solve_pose
from marey.motion.resample import interpolate
from marey.motion.rotations import Array
from marey.vocabulary.turns import Turn

Float32 = NDArray[np.float32]

NEAR = 5.0
"""Degrees by which a turn may differ."""
MOST_SCALED = 1.6
"""How many times as large a turn is made at most; what is missing to a larger one is added in the middle."""
TOO_FAR, NEAR_ENOUGH = 1.3, (0.75, 1.3)
"""How many times as large as asked for a turn is that ends sooner, and bounds of that with which it ends."""
SHORTEST_S, SLOWS_S, STILL_S = 0.5, 0.3, 0.5
"""Seconds of the shortest turn, those of its end that are played at a pace that falls to 0, and those of standing
still."""
FASTEST = 150.0
"""Degrees a second of a turn that is added: steps on the spot keep up with it."""


def turned_features(features: Float32, layout: FeatureLayout, turn: Turn, side: str) -> tuple[Float32, float] | None:
    """Return features (T, D) that turn as far as is asked for, and the degrees (positive to the left) by which the
    motion turned before; None if it turns so far by itself, or has no time to.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        turn: what is asked for.
        side: `left` or `right`, for a motion that hardly turns by itself; any other means left.
    """
    joints = layout.decode(features).astype(np.float64)
    natural = natural_course(joints, layout.skeleton, layout.fps)
    made = natural.turn
    wanted = turn.of(made)
    if abs(abs(made) - wanted) <= NEAR and not turn.even:
        return None
    sign = (-1.0 if side == "right" else 1.0) if abs(made) < turn.least / 4 else math.copysign(1.0, made)
    headings = _headings(natural.headings, math.radians(sign * wanted), layout.fps, even=turn.even)
    if headings is None:
        return None
    return encode_all(layout, bent_along(joints, layout, natural, natural.facing(headings))), made


def ended_turn(features: Float32, layout: FeatureLayout, turn: Turn) -> Float32 | None:
    """Return features (T', D) of the first part of a turn on the spot that turns much farther than is asked for, and
    comes to rest; None if it does not, or both feet never stand when it has turned so far.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        turn: what is asked for.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    natural = natural_course(joints, layout.skeleton, fps)
    wanted = math.radians(turn.least + turn.most) / 2
    turns = np.abs(natural.headings - natural.headings[0])
    if turn.even or turn.whole or not turn.least or abs(natural.turn) <= TOO_FAR * turn.most:
        return None
    contacts = find_contacts(joints, layout.skeleton, fps)
    stands = contacts[:, :2].any(axis=1) & contacts[:, 2:].any(axis=1)
    near = stands & (turns > NEAR_ENOUGH[0] * wanted) & (turns < NEAR_ENOUGH[1] * wanted)
    near[: round(SHORTEST_S * fps)] = False
    if not near.any():
        return None
    end = int(np.flatnonzero(near)[np.abs(turns[near] - wanted).argmin()])
    return encode_all(layout, _brought_to_rest(joints[: end + 1], fps))


def _brought_to_rest(joints: Array, fps: float) -> Array:
    """Return joints (T', J, 3) whose last movement slows down, and that stand still afterwards."""
    slows, slowed, still = (round(seconds * fps) for seconds in (SLOWS_S, 2 * SLOWS_S, STILL_S))
    passed = np.arange(1.0, slowed + 1) / slowed
    last = float(len(joints) - 1)
    times = np.concatenate([np.arange(last - slows + 1), last - slows * (1 - passed) ** 2, np.full(still, last)])
    return interpolate(joints, times)


def _headings(headings: Array, wanted: float, fps: float, *, even: bool) -> Array | None:
    """Return headings (T,) that turn by `wanted` radians; None if there is no time to."""
    turns, frames = headings - headings[0], len(headings)
    time = np.linspace(0.0, 1.0, frames)
    if even:
        return headings[0] + wanted * time + (turns - turns[-1] * time) * (turns[-1] * wanted > 0)
    made = turns[-1]
    share = wanted / made if made * wanted > 0 else 0.0
    if share > MOST_SCALED or (wanted and not share):
        share = MOST_SCALED if share else 1.0
    missing = wanted - share * made
    span = min(2 * abs(missing) / math.radians(FASTEST) * fps / frames, 1.0)
    if abs(missing) > math.radians(FASTEST) * frames / fps / 1.5:
        return None
    span = max(span, 0.5)
    added = smoothstep(np.clip((time - 0.5) / span + 0.5, 0.0, 1.0))
    return headings[0] + share * turns + missing * added


def bent_along(joints: Array, layout: FeatureLayout, natural: Course, wanted: Course) -> Array:
    """Return joints (T, J, 3) of a motion bent to another course than its own."""
    skeleton, fps = layout.skeleton, layout.fps
    pose = solve_pose(bone_fit(skeleton).fit(joints), skeleton, fps=fps, measure=False)
    contacts = find_contacts(joints, skeleton, fps)
    rotations, root, _ = bent(pose.rotations, pose.root, contacts, natural, wanted, skeleton, fps)
    return forward_kinematics(skeleton, rotations, root)
