"""Lay captured straight ways onto curves, with longer or shorter strides.

Travel is moved by maps of the floor that do not change with time, so that a standing foot stays where it stands. Each
foot has the direction of the way where it steps, the body that of the way where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.data.part import FPS
from marey.drawing.placed import about_vertical, posed, spine_yaw
from marey.motion.filters import smooth_seconds
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import CARRIED, GRAVITY
from marey.posing.standing import eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_GRID = 0.01  # metres
_BANK = 0.6  # share of the lean of a body that leans against all of the pull outward
_HIPS_INWARD = 0.5  # metres that the hips move inward per radian of lean


@dataclass(frozen=True)
class Bending:
    """Turning of a way.

    Attributes:
        degrees: of the whole turn, positive to the left.
        start, end: between which shares of the way it turns.
        look: metres by which the shoulders are ahead of the hips in the turn.
    """

    degrees: float = 0.0
    start: float = 0.0
    end: float = 1.0
    look: float = 0.2

    def angle(self, share: Array) -> Array:
        """Radians turned at shares of the way; half of it grows evenly, so that arcs are round."""
        x = np.clip((share - self.start) / (self.end - self.start), 0.0, 1.0)
        return np.radians(self.degrees) * (0.5 * eased(x) + 0.5 * x)


STRAIGHT = Bending()


def relaid(joints: Array, *, stride: float = 1.0, curve: Bending = STRAIGHT) -> Array:
    """Lay a straight way (T, 22, 3) onto a curve.

    Args:
        joints: the body going straight, forward or backward.
        stride: length of the steps relative to the captured ones.
        curve: how the way turns.
    """
    joints = np.asarray(joints, np.float64)
    whole = (joints[-1, 0] - joints[0, 0]) * np.array([1.0, 0.0, 1.0])
    ahead = np.arctan2(whole[0], whole[2])
    local = about_vertical(joints - joints[0, 0] * np.array([1.0, 0.0, 1.0]), np.full(joints.shape[:2], -ahead))
    length = np.linalg.norm(whole) * stride
    along = np.arange(-1.5, length + 1.5, _GRID)
    angle = curve.angle(along / length)
    centre = np.cumsum(np.stack([np.sin(angle), np.cos(angle)], axis=-1) * _GRID, axis=0)

    def at(places: Array) -> tuple[Array, Array]:
        """Places (..., 3) on the curve and the radians turned there."""
        s = places[..., 2] * stride
        turn = np.interp(s, along, angle)
        x = np.interp(s, along, centre[:, 0]) + places[..., 0] * np.cos(turn)
        z = np.interp(s, along, centre[:, 1]) - places[..., 0] * np.sin(turn)
        return np.stack([x, places[..., 1], z], axis=-1), turn

    root, hips = at(local[:, 0])
    ahead_of = local[:, 0] + np.array([0.0, 0.0, curve.look / stride])
    bank = _bank(root, hips)
    root = root + about_vertical(np.stack([_HIPS_INWARD * bank, 0 * bank, 0 * bank], axis=-1), hips)
    toes, toe_yaw = at(local[:, _TOES])
    tilted = _tilted(local, bank)
    return posed(tilted, root, spine_yaw(hips, at(ahead_of)[1]), toes, toe_yaw)


def _bank(root: Array, turn: Array) -> Array:
    """Radians (T,) by which a body leans into a curve, positive to the left."""
    if not np.ptp(turn):
        return np.zeros(len(turn))
    speed = np.linalg.norm(np.gradient(root[:, [0, 2]], axis=0), axis=-1) * FPS
    pull = speed * np.gradient(turn) * FPS
    return smooth_seconds(_BANK * np.arctan(pull / GRAVITY), 0.2, FPS)


def _tilted(local: Array, bank: Array) -> Array:
    """Lean the upper body of one that goes along Z by radians (T,) to its left."""
    turned = from_rotvec(np.stack([0 * bank, 0 * bank, -bank], axis=-1))
    upper = [j for j in CARRIED[1:] if j not in (1, 2)]
    out = local.copy()
    out[:, upper] = local[:, :1] + rotate(turned[:, None], local[:, upper] - local[:, :1])
    return out
