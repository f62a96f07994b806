"""Bones of constant length on the body that captures are put on: limbs of two bones, and whole poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import between, cross, from_rotvec, normalize, rotate
from marey.posing.curves import blurred
from marey.posing.limbs import BONE_LENGTHS, CARRIED, LEG_CHAINS, PARENTS

Array = NDArray[np.floating]

_MAX_REACH = 0.9995  # a fully stretched leg has no knee plane
_PLANE_TURN = 30.0  # degrees a frame by which the plane of a limb turns about its line at most
_UNSURE = 0.02  # weight of a pole that lies on the line
_WIDER, _WIDEST = 1.25, 20.0  # factor of the widths, in frames, that are tried to slow such a plane, and the last one


def two_bones(hip: Array, ankle: Array, pole: Array, lengths: tuple[float, float]) -> tuple[Array, Array]:
    """Solve the knee (T, 3) by the cosine rule, bent towards `pole`; move the ankle (T, 3) into reach if needed."""
    upper, lower = lengths
    line = ankle - hip
    distance = np.linalg.norm(line, axis=-1, keepdims=True)
    axis = line / distance
    distance = np.clip(distance, abs(upper - lower) + 1e-3, (upper + lower) * _MAX_REACH)
    pole = steady_bends(axis, pole)
    along = (distance**2 + upper**2 - lower**2) / (2 * distance)
    aside = np.sqrt(np.maximum(upper**2 - along**2, 0.0))
    return hip + along * axis + aside * pole, hip + distance * axis


def steady_bends(axis: Array, pole: Array) -> Array:
    """Unit vectors (T, 3) across the line of a limb towards `pole`, which turn about the line no faster than a joint.

    Where the line passes by the pole, the direction across it turns around within a frame, and the elbow with it; there
    the angle about the line is blurred, by the least width that slows it, and little where the pole is far from the
    line. Everything else stays as it is.

    Args:
        axis: (T, 3) unit vectors from the shoulder or hip to the wrist or ankle.
        pole: (T, 3) where the elbow or knee points.
    """
    aside = pole - axis * np.einsum("ti,ti->t", pole, axis)[:, None]
    bends = normalize(aside).astype(np.float64)
    turns = _turns(axis, bends)
    if not np.any(np.abs(turns) > np.radians(_PLANE_TURN)):
        return bends
    angles = np.concatenate([[0.0], np.cumsum(turns)])
    sure = np.einsum("ti,ti->t", aside, aside) + _UNSURE
    steady, width = angles, 1.0
    while np.abs(np.diff(steady)).max() > np.radians(_PLANE_TURN) and width < _WIDEST:
        total, weight = blurred(np.stack([sure * angles, sure], axis=1), width).T
        steady, width = total / weight, _WIDER * width
    return rotate(from_rotvec(axis * (steady - angles)[:, None]), bends)


def _turns(axis: Array, bends: Array) -> Array:
    """Radians (T - 1,) about the line by which the direction across it turns, apart from how the line turns."""
    carried = rotate(between(axis[:-1], axis[1:]), bends[:-1])
    sine = np.einsum("ti,ti->t", axis[1:], cross(carried, bends[1:]))
    return np.arctan2(sine, np.einsum("ti,ti->t", carried, bends[1:]))


def directions_of(joints: Array) -> Array:
    """(n, 22, 3) unit vectors from each joint's parent."""
    return normalize(joints - joints[:, PARENTS]).astype(np.float64)


def knee_poles(joints: Array) -> Array:
    """Unit vectors (T, 2, 3) from the line between hip and ankle to the knee, with a little forward added."""
    left = joints[:, 1] - joints[:, 2]
    forward = normalize(cross(left, np.broadcast_to([0.0, 1.0, 0.0], left.shape)))
    out = []
    for hip, knee, ankle, _ in LEG_CHAINS:
        axis = normalize(joints[:, ankle] - joints[:, hip])
        bend = joints[:, knee] - joints[:, hip]
        bend = bend - axis * np.einsum("ti,ti->t", bend, axis)[:, None]
        out.append(bend + 0.03 * forward)
    return normalize(np.stack(out, axis=1)).astype(np.float64)


def rebuilt(root: Array, directions: Array, toes: Array, poles: Array) -> Array:
    """Return joints (n, 22, 3) with bones of the skeleton's lengths.

    Args:
        root: (n, 3) the pelvis, metres.
        directions: (n, 22, 3) of the bones that end in each joint.
        toes: (n, 2, 3) where the toes are, metres.
        poles: (n, 2, 3) where the knees point.
    """
    joints = np.empty((len(root), 22, 3))
    joints[:, 0] = root
    for j in CARRIED[1:]:
        joints[:, j] = joints[:, PARENTS[j]] + BONE_LENGTHS[j] * directions[:, j]
    for side, (hip, knee, ankle, toe) in enumerate(LEG_CHAINS):
        foot = BONE_LENGTHS[toe] * directions[:, toe]
        wanted = toes[:, side] - foot
        joints[:, knee], joints[:, ankle] = two_bones(
            joints[:, hip], wanted, poles[:, side], (BONE_LENGTHS[knee], BONE_LENGTHS[ankle])
        )
        joints[:, toe] = joints[:, ankle] + foot
    return joints


def with_bones(joints: Array) -> Array:
    """Restore the skeleton's bone lengths in poses (T, 22, 3), metres: bones keep their directions, the pelvis and the
    toes their places, as far as a leg reaches; the knees are solved."""
    return rebuilt(joints[:, 0], directions_of(joints), joints[:, [10, 11]], knee_poles(joints))
