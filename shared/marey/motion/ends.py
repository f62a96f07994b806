"""Toes that bend and wrists that give: the turns of joints at the ends of limbs, which no other joint shows.

The places of joints do not tell how a toe or a hand is turned. Toes of a foot that rolls over its ball stay on the
floor, and hands on which a body leans lie flat: each bends about its own axis, by as little as keeps its tip over the
floor. A hand that is swung comes a little after its forearm. No joint moves by it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.motion.body import STATURE, stature
from marey.motion.filters import smooth, smooth_above, smoothstep
from marey.motion.hands import arms
from marey.motion.kinematics import UP, forward_kinematics, global_rotations
from marey.motion.resample import interpolate_rotations
from marey.motion.rotations import (
    Array,
    conjugate,
    cross,
    dot,
    from_rotvec,
    multiply,
    normalize,
    rotate,
    to_rotvec,
    unroll,
)
from marey.motion.skeleton import Skeleton

AHEAD = np.array([0.0, 0.0, 1.0])
LAG_S, LAG_SHARE, MOST_LAG = 0.06, 0.7, 14.0
"""Seconds by which a hand comes after its forearm, the share of that which is seen, and degrees at most."""
LAG_PASSES_S = 0.03
"""Standard deviation of the filter that makes a hand's lag smooth, seconds."""
CLEAR = 0.2
"""Metres of a hand over the floor from which on it lags freely."""
BACK = 0.35
"""How much a hand bends towards its back, beside upward."""
EASE_S = 0.045
"""Standard deviation of the filter that eases bends, seconds."""
HOLDS_S = 0.03
"""Standard deviation of the filter by which toes come to stand, seconds."""


@dataclass(frozen=True)
class End:
    """The bone beyond a joint at the end of a limb, of a body of `STATURE`.

    Attributes:
        length: metres to its tip.
        thick: metres between the tip and the floor on which it lies.
        up, down: degrees by which it bends towards its upper side and its lower one, at most.
    """

    length: float
    thick: float
    up: float
    down: float


TOES = End(0.055, 0.0, 65.0, 35.0)
HAND = End(0.14, 0.02, 85.0, 70.0)
OVER = np.radians(20.0)
"""How far past straight down an end still bends towards its upper side: toes of one who kneels are curled under."""


ASIDE = 0.35
"""Share of its bend that is up and down below which an end lies on its side, and bends less."""


def turn_ends(rotations: Array, root: Array, contacts: NDArray[np.bool_], skeleton: Skeleton, fps: float) -> Array:
    """Return a pose with toes and hands that are turned; those of a skeleton without known feet or arms are left.

    Args:
        rotations: (T, J, 4) local quaternions; joints at the ends of limbs do not turn yet.
        root: (T, 3) metres, over a floor at y = 0.
        contacts: (T, 4) of `Skeleton.feet`; toes that stand lie flat, however high.
        skeleton: of the body.
        fps: frames a second.

    Returns:
        (T, J, 4) local quaternions, continuous in sign.
    """
    world = global_rotations(skeleton, rotations)
    joints = forward_kinematics(skeleton, rotations, root, world=world)
    size = stature(skeleton) / STATURE
    turned = np.array(rotations, np.float64)
    above = np.broadcast_to(UP, root.shape)
    for toe, stands in zip(skeleton.feet[1::2], contacts.T[1::2], strict=True):
        if not skeleton.children[toe]:
            hold = smooth(stands[:, None].astype(np.float64), HOLDS_S * fps)[:, 0]
            high = (1.0 - hold) * joints[:, toe, 1]
            turned[:, toe] = _bent(world[:, toe], AHEAD, above, high, TOES, size, fps)
    if skeleton.facing:
        for _, elbow, wrist in arms(skeleton):
            if not skeleton.children[wrist]:
                way = normalize(skeleton.offsets[wrist].astype(np.float64))
                high = joints[:, wrist, 1]
                lying = _bent(world[:, wrist], way, _upward(world[:, wrist], way), high, HAND, size, fps)
                tip = high + size * HAND.length * rotate(world[:, wrist], way)[:, 1]
                free = smoothstep(np.clip((np.minimum(tip, high) / size - HAND.thick) / CLEAR, 0.0, 1.0))
                lag = free[:, None] * _lag(world[:, elbow], way, fps)
                turned[:, wrist] = multiply(from_rotvec(lag), lying)
    return unroll(turned)


def _bent(world: Array, way: Array, over: Array, high: Array, end: End, size: float, fps: float) -> Array:
    """Return the local turns (T, 4) of an end that bends by as little as keeps its tip over the floor, and that begins
    to bend a moment before it must.

    Args:
        world: (T, 4) how it is turned before.
        way: (3,) where it points in its rest.
        over: (T, 3) where it bends to, in its own axes, across its way.
        high: (T,) metres of its joint over the floor.
        size: of the body, as a share of `STATURE`.
    """
    along, above = rotate(world, way)[:, 1], rotate(world, over)[:, 1]
    # Bent by an angle b the tip is length * far * cos(b - top) over its joint.
    far = np.hypot(along, above)
    top = np.arctan2(above, along)
    top = np.where(top < OVER - np.pi, top + 2 * np.pi, top)
    room = np.arccos(np.clip((end.thick - high / size) / (end.length * np.maximum(far, ASIDE)), -1.0, 1.0))
    bend = np.sign(top) * np.maximum(np.abs(top) - room, 0.0)
    bend = np.clip(bend, -np.radians(end.down), np.radians(end.up)) * np.minimum(far / ASIDE, 1.0)
    bend = smooth_above(np.maximum(bend, 0.0), EASE_S * fps) - smooth_above(np.maximum(-bend, 0.0), EASE_S * fps)
    return from_rotvec(bend[:, None] * cross(np.broadcast_to(way, over.shape), over))


def _upward(world: Array, way: Array) -> Array:
    """Return where hands bend to (T, 3), in their own axes: upward, and those that point down to their back."""
    up = rotate(conjugate(world), np.broadcast_to(UP, (len(world), 3)))
    return normalize(up - (up @ way)[:, None] * way + BACK * UP)


def _lag(forearm: Array, way: Array, fps: float) -> Array:
    """Return the local rotation vectors (T, 3) by which a hand comes after its forearm.

    Args:
        forearm: (T, 4) its turns in the world.
        way: (3,) where it points in its rest.
    """
    times = np.maximum(np.arange(len(forearm)) - LAG_S * fps, 0.0)
    behind = LAG_SHARE * to_rotvec(multiply(conjugate(forearm), interpolate_rotations(forearm, times)))
    behind = smooth(behind - dot(behind, way[None])[:, None] * way, LAG_PASSES_S * fps)
    most = np.radians(MOST_LAG)
    return behind * most / np.hypot(most, np.linalg.norm(behind, axis=-1, keepdims=True))
