"""Leg solver for moved feet: closed-form two-bone inverse kinematics that keeps bone lengths.

In a leg close to straight, a millimetre at the foot is centimetres at the knee, so a moved foot may hardly stretch it:
first the heel comes up around the toe, as in walking, then the hips come down a little, and last the foot leaves its
place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth, smooth_above, smoothstep
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, between, dot, length, normalize, rotate
from marey.motion.skeleton import Skeleton

STRETCH = 0.99  # of its length: limit for a leg that was not straighter before (16 degrees)
KNEE_ROOM = 0.03
"""Metres of a knee over the floor."""
MAX_DROP = 0.06  # metres that the hips come down for a foot; beyond that the foot leaves its place


def foot_chain(skeleton: Skeleton, toe: int) -> list[int]:
    """Joints from the toe up to the end of the leg: toe, …, the knee's child."""
    knees = {skeleton.children[hip][0] for hip in skeleton.facing[:2]}
    chain = [toe]
    while skeleton.parents[chain[-1]] not in knees:
        chain.append(skeleton.parents[chain[-1]])
    return chain


def follow_feet(
    before: Array,
    joints: Array,
    stands: NDArray[np.bool_],
    skeleton: Skeleton,
    fps: float,
    *,
    most_drop: Array | float = MAX_DROP,
) -> None:
    """Adjust hips and knees to moved feet, in place.

    Args:
        before: (T, J, 3) the motion before its feet were moved.
        joints: (T, J, 3) the same with moved feet, metres; all joints are changed where necessary.
        stands: (T, 2) bool: left and right toe stand and must stay in place.
        skeleton: must have hips and feet.
        fps: frames a second.
        most_drop: metres that the hips come down at most, for all frames or for each (T,).
    """
    r_hip, l_hip = skeleton.facing[:2]
    chains = [foot_chain(skeleton, toe) for toe in skeleton.feet[1::2]]
    legs = [[hip, skeleton.children[hip][0], chain[-1]] for hip, chain in zip((l_hip, r_hip), chains, strict=True)]
    held = [smooth_above(stands[:, side].astype(np.float64), 0.04 * fps) for side in range(2)]
    needed = [
        hold * needed_drop(before[:, leg], joints[:, leg[0]], joints[:, chain])
        for leg, chain, hold in zip(legs, chains, held, strict=True)
    ]
    drop = np.minimum(smooth_above(np.max(needed, axis=0), 0.1 * fps), most_drop)
    body = [j for j in range(len(skeleton)) if j not in chains[0] + chains[1]]
    joints[:, body, 1] -= drop[:, None]
    ahead = smooth(facing(before, skeleton), 0.2 * fps)
    for leg, chain, hold in zip(legs, chains, held, strict=True):
        hip, ankle = joints[:, leg[0]], joints[:, leg[2]]
        was = _without_backward_bend(before[:, leg], ahead, fps)
        wanted = soft_distance(was, length(ankle - hip), fps)
        joints[:, chain] = draw_foot(joints[:, chain], hip, wanted, hold)
        knee = two_bone_knee(was, hip, joints[:, leg[2]], ahead)
        out = hip - joints[:, [l_hip, r_hip]].mean(axis=1)
        joints[:, leg[1]] = knee_over_floor(knee, hip, joints[:, leg[2]], before[:, leg[1], 1], out)


def knee_over_floor(knee: Array, hip: Array, ankle: Array, height: Array, out: Array) -> Array:
    """Return knees (T, 3) turned about the line from hip to ankle until none is in the floor, or lower than before:
    the straight leg of a body that lies on its front bends into it.

    Args:
        knee, hip, ankle: (T, 3) after the move, metres.
        height: (T,) of the knee before.
        out: (T, 3) direction away from the other leg, to which a knee turns that points straight down.
    """
    least = np.minimum(height, KNEE_ROOM)
    if not (knee[:, 1] < least).any():
        return knee
    axis = normalize(ankle - hip)
    foot = hip + axis * dot(knee - hip, axis)[:, None]
    up = normalize(np.array([0.0, 1.0, 0.0]) - axis * axis[:, 1:2])
    side = np.cross(axis, up)
    bend = knee - foot
    off = np.maximum(length(bend), 1e-9)
    rises = np.clip((least - foot[:, 1]) / np.maximum(off * up[:, 1], 1e-9), -1.0, 1.0)
    aside = np.where(dot(bend, side) / off + 0.3 * np.sign(dot(out, side)) < 0, -1.0, 1.0)
    turned = rises[:, None] * up + (aside * np.sqrt(1.0 - rises**2))[:, None] * side
    return np.where((knee[:, 1] < least)[:, None], foot + off[:, None] * turned, knee)


def leg_lengths(leg: Array) -> tuple[Array, Array]:
    """Return the lengths (...) of thigh and shank of (..., 3, 3)."""
    bones = length(leg[..., 1:, :] - leg[..., :-1, :])
    return bones[..., 0], bones[..., 1]


def needed_drop(leg: Array, hip: Array, foot: Array) -> Array:
    """Return by how much (T,) the hip must come down until leg and foot together reach the toe.

    Args:
        leg: (T, 3, 3) hip, knee and ankle, for its lengths, metres.
        hip: (T, 3) where the hip is.
        foot: (T, n, 3) the foot, toe first and ankle last.
    """
    across, span = foot[:, 0] - hip, length(foot[:, -1] - foot[:, 0])
    reach = 0.99 * (sum(leg_lengths(leg)) + span)
    room = np.sqrt(np.maximum(reach**2 - across[:, 0] ** 2 - across[:, 2] ** 2, 0.0))
    return np.clip(np.where(across[:, 1] < 0, -across[:, 1] - room, 0.0), 0.0, MAX_DROP)


def _without_backward_bend(leg: Array, ahead: Array, fps: float) -> Array:
    """Return the same leg (T, 3, 3) with knees that a decoder bent backwards by some degrees brought forward to
    straight.

    A knee that swings through straight to the wrong side would have to jump to the right one when its foot is moved.
    The ankle comes nearer or farther by less than a millimetre.
    """
    hip, knee, ankle = leg[:, 0], leg[:, 1], leg[:, 2]
    axis = normalize(ankle - hip)
    across = (knee - hip) - axis * dot(knee - hip, axis)[:, None]
    pole = smooth(across, 0.15 * fps) + 0.03 * ahead  # the direction that this knee bends to at that time
    pole = normalize(pole - axis * dot(pole, axis)[:, None])
    slight = np.clip((0.06 - length(across)) / 0.02, 0.0, 1.0)  # of 6 cm: more is another pose
    cover = smooth_above(slight * np.maximum(-dot(across, pole), 0.0), 0.03 * fps)
    if not cover.any():
        return leg
    l1, l2 = leg_lengths(leg)
    across = across + cover[:, None] * pole
    off = np.minimum(length(across), np.minimum(l1, l2))
    along, below = np.sqrt(l1**2 - off**2), np.sqrt(l2**2 - off**2)
    fixed = np.stack([hip, hip + along[:, None] * axis + across, hip + (along + below)[:, None] * axis], axis=1)
    return np.where((cover > 0)[:, None, None], fixed, leg)


def soft_distance(leg: Array, distance: Array, fps: float) -> Array:
    """Return distances (T,) from hip to ankle, close to the requested ones, but without jumps of the knee.

    The nearer a leg is to `STRETCH`, the less it is stretched; and where it is nearly straight, what the knee moves off
    its line is smoothed in time, which costs the ankle less than a millimetre.

    Args:
        leg: (T, 3, 3) before the move, metres.
        distance: (T,) requested distance, metres.
    """
    l1, l2 = leg_lengths(leg)
    was = length(leg[:, 2] - leg[:, 0])
    wanted = soft_stretch(was, distance, l1 + l2)
    off_was = _bend(was, l1, l2)[1]
    change = smooth((_bend(wanted, l1, l2)[1] - off_was)[:, None], 0.04 * fps)[:, 0]
    off = np.clip(off_was + change, 0.0, np.minimum(l1, l2))
    smoothed = np.sqrt(l1**2 - off**2) + np.sqrt(l2**2 - off**2)
    straight = np.clip((was / np.maximum(l1 + l2, 1e-9) - 0.85) / 0.1, 0.0, 1.0)
    return wanted + smoothstep(straight) * (smoothed - wanted)


def soft_stretch(was: Array, distance: Array, reach: Array) -> Array:
    """Return the distance (...) from hip to ankle: as requested where that is nearer than before, else reduced the
    more, the nearer the leg is to `STRETCH` of its reach, which it never exceeds."""
    stretch, room = distance - was, np.maximum(STRETCH * reach - was, 1e-4)
    return np.where(stretch > 0, was - room * np.expm1(-np.maximum(stretch, 0.0) / room), distance)


def draw_foot(foot: Array, hip: Array, wanted: Array, hold: Array) -> Array:
    """Move a foot (..., n, 3), toe first, so that its ankle is at the wanted distance (...) from the hip (..., 3).

    Where the toe is held (1) the foot turns around it, heel up or down; where it is not (0), the whole foot moves.
    """
    toe, ankle = foot[..., 0, :], foot[..., -1, :]
    distance = length(ankle - hip)
    up, sole = hip - toe, ankle - toe
    far, span = length(up), length(sole)
    up = normalize(up)
    turned = distance + hold * (wanted - distance)
    cosine = (span * span + far * far - turned * turned) / np.maximum(2 * span * far, 1e-9)
    cosine = np.minimum(np.maximum(cosine, -1.0), 1.0)  # np.clip takes three times as long on a single frame
    beside = normalize(sole - up * dot(up, sole)[..., None])
    raised = span[..., None] * (cosine[..., None] * up + np.sqrt(1 - cosine * cosine)[..., None] * beside)
    turn = between(sole, np.where((np.abs(turned - distance) > 1e-7)[..., None], raised, sole))
    foot = toe[..., None, :] + rotate(turn[..., None, :], foot - toe[..., None, :])
    across = foot[..., -1, :] - hip
    over = length(across) - wanted
    return foot - (over[..., None] * normalize(across))[..., None, :]


def _bend(distance: Array, l1: Array, l2: Array) -> tuple[Array, Array]:
    """Return the knee's position for a distance (...) from hip to ankle: along the line between them, and off it."""
    distance = np.maximum(np.minimum(np.maximum(distance, np.abs(l1 - l2)), l1 + l2), 1e-9)
    along = (distance * distance + l1 * l1 - l2 * l2) / (2 * distance)
    return along, np.sqrt(np.maximum(l1 * l1 - along * along, 0.0))


def two_bone_knee(leg: Array, hip: Array, ankle: Array, ahead: Array) -> Array:
    """Return the knee's position after hip and ankle have moved, with both bone lengths unchanged.

    The leg is turned as a whole to its new direction and then bent or stretched in its plane; the knee of a leg that
    did not move stays bit for bit. A straight leg that must bend bends towards `ahead`.

    Args:
        leg: (..., 3, 3) hip, knee and ankle before, metres.
        hip, ankle: (..., 3) new positions; out of reach, the leg points to the ankle and is straight.
        ahead: (..., 3) direction that knees bend to.

    Returns:
        (..., 3).
    """
    upper, whole = leg[..., 1, :] - leg[..., 0, :], leg[..., 2, :] - leg[..., 0, :]
    now = ankle - hip
    l1, l2 = leg_lengths(leg)
    turn = between(whole, now)
    axis = normalize(now)
    knee = rotate(turn, upper)

    along_was, off_was = _bend(length(whole), l1, l2)
    along, off = _bend(length(now), l1, l2)
    pole = knee - along_was[..., None] * axis
    prior = ahead - axis * dot(ahead, axis)[..., None]
    pole = normalize(pole + 0.03 * prior)  # 3 cm off the line is a bend of 9 degrees: enough to know the plane
    knee = knee + (off - off_was)[..., None] * pole
    plane = knee - axis * dot(knee, axis)[..., None]
    return hip + along[..., None] * axis + off[..., None] * normalize(plane + 1e-9 * prior)
