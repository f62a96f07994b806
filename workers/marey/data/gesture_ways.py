"""Lay captured straight ways onto curves, with longer or shorter strides.

Travel is moved by maps of the floor that do not change with time, so that a standing foot stays where it stands. Each
foot has the direction of the way where it steps, the body that of the way where it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.data.part import FPS
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.bones import knee_poles, with_bones
from marey.posing.limbs import CARRIED, GRAVITY, LEG_CHAINS, PARENTS
from marey.posing.standing import eased

Array = NDArray[np.floating]

_TOES = [10, 11]
_AHEAD = {3: 0.2, 6: 0.4, 9: 0.7}  # share by which the spine is turned like the shoulders
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


def posed(joints: Array, root: Array, yaw: Array, toes: Array, toe_yaw: Array) -> Array:
    """Turn and move a body whose feet are placed independently.

    Args:
        joints: (T, 22, 3) metres.
        root: (T, 3) new places of the root.
        yaw: (T, 22) radians by which the bone that ends in each joint is turned about the vertical; legs: the hips.
        toes: (T, 2, 3) new places of the toes.
        toe_yaw: (T, 2) radians by which the feet are turned.
    """
    bones = joints - joints[:, PARENTS]
    poles = knee_poles(joints)
    out = np.empty_like(joints)
    out[:, 0] = root
    for j in CARRIED[1:]:
        out[:, j] = out[:, PARENTS[j]] + about_vertical(bones[:, j], yaw[:, j])
    for side, (hip, knee, ankle, toe) in enumerate(LEG_CHAINS):
        out[:, toe] = toes[:, side]
        out[:, ankle] = toes[:, side] - about_vertical(bones[:, toe], toe_yaw[:, side])
        pole = about_vertical(poles[:, side], (yaw[:, hip] + toe_yaw[:, side]) / 2)
        out[:, knee] = (out[:, hip] + out[:, ankle]) / 2 + 0.1 * pole
    return with_bones(out)


def about_vertical(vectors: Array, yaw: Array) -> Array:
    """Turn vectors (..., 3) by radians (...) about the vertical; positive is to the left."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x + sin * z, y, cos * z - sin * x], axis=-1)


def spine_yaw(hips: Array, shoulders: Array) -> Array:
    """Turning (T, 22) of each bone from that of the hips and that of the shoulders (T,)."""
    share = np.ones(22)
    share[[1, 2]] = 0.0
    share[list(_AHEAD)] = list(_AHEAD.values())
    return hips[:, None] + (shoulders - hips)[:, None] * share


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
    return smooth(_BANK * np.arctan(pull / GRAVITY), 0.2, FPS)


def _tilted(local: Array, bank: Array) -> Array:
    """Lean the upper body of one that goes along Z by radians (T,) to its left."""
    turned = from_rotvec(np.stack([0 * bank, 0 * bank, -bank], axis=-1))
    upper = [j for j in CARRIED[1:] if j not in (1, 2)]
    out = local.copy()
    out[:, upper] = local[:, :1] + rotate(turned[:, None], local[:, upper] - local[:, :1])
    return out
