"""Steps of a standing body into a stance and back, turned hips, and smooth paths."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import from_rotvec, normalize, rotate
from marey.motion.skeleton import HUMANML3D
from marey.posing.curves import blurred, monotone
from marey.posing.limbs import FPS, LEVEL
from marey.posing.standing import LEFT, LEGS, StandingBody, eased

Array = NDArray[np.floating]

_LEG = float(np.linalg.norm(HUMANML3D.offsets[[4, 7]], axis=1).sum())
_STRETCHED = 0.985  # share of its length that a leg may stretch to
_SMOOTH = 1.5  # frames
_KNEE = 0.1  # metres, only the direction counts


def glide(frames: int, times: Sequence[float], points: Array | Sequence[Sequence[float]]) -> Array:
    """Smooth path (frames, K) through points (n, K) at `times` in seconds, increasing, without stops between and
    without passing beyond a point; ends are held."""
    return monotone(times, points, np.arange(frames) / FPS)


def step(
    body: StandingBody,
    side: str,
    move: tuple[float, float],
    start: float,
    seconds: float,
    *,
    turn: float = 0.0,
    lift: float = 0.06,
) -> Array:
    """Move a foot in one step; a step back is one by the negative amounts.

    Args:
        body: whose foot moves; the hips stay.
        side: of the foot.
        move: metres outward and forward.
        start: seconds; negative for a foot that stands there from the first frame on.
        seconds: that it takes.
        turn: degrees by which the toes turn outward.
        lift: metres over the floor.

    Returns:
        (T,) progress of the step, 0 to 1.
    """
    frames = len(body.joints)
    _, _, ankle, toe = LEGS[side]
    w = eased((np.arange(frames) / FPS - start) / seconds)
    along = body.world(np.tile([move[0], 0.0, move[1]], (frames, 1)), side)[0]
    moved = w[:, None] * along + (4 * w * (1 - w) * lift)[:, None] * np.array([0.0, 1.0, 0.0])
    sign = 1.0 if side == LEFT else -1.0
    turned = from_rotvec(np.array([0.0, 1.0, 0.0]) * np.radians(sign * turn * w)[:, None])
    foot = rotate(turned, body.joints[:, toe] - body.joints[:, ankle])
    body.joints[:, ankle] += moved
    body.joints[:, toe] = body.joints[:, ankle] + foot
    return w


def turn_hips(body: StandingBody, degrees: Array) -> None:
    """Turn the hips and all above them to the left by `degrees` (T,); the feet stay."""
    body.turn(0, "up", degrees, besides=(1, 2))


def turn_about_foot(body: StandingBody, side: str, times: Sequence[float], degrees: Sequence[float]) -> None:
    """Turn a whole body about the toes of one foot, which stays where it is.

    Args:
        body: whose other foot is in the air meanwhile.
        side: of the foot.
        times: seconds, increasing.
        degrees: by which the body has turned to the left then.
    """
    joints = body.joints
    turned = glide(len(joints), times, [[each] for each in degrees])
    pivot = joints[min(round(times[0] * FPS), len(joints) - 1), LEGS[side][-1]] * LEVEL
    about = np.array([0.0, 1.0, 0.0]) * np.radians(turned)
    joints[:] = pivot + rotate(from_rotvec(about)[:, None], joints - pivot)


def settle(body: StandingBody) -> None:
    """Lower the hips where the legs would not reach the feet, and let the knees point ahead, as the feet do."""
    drops = []
    for hip, _, ankle, _ in LEGS.values():
        seen = body.joints[:, ankle] - body.joints[:, hip]
        height = np.sqrt(np.maximum((_STRETCHED * _LEG) ** 2 - (seen[:, [0, 2]] ** 2).sum(1), 0.0))
        drops.append(np.maximum(-seen[:, 1] - height, 0.0))
    lowest = np.lib.stride_tricks.sliding_window_view(np.pad(np.max(drops, axis=0), 2, mode="edge"), 5)
    body.shift(-blurred(lowest.max(axis=1), _SMOOTH))
    forward = body.world(np.tile([0.0, 0.0, 1.0], (len(body.joints), 1)), LEFT)
    for hip, knee, ankle, toe in LEGS.values():
        foot = (body.joints[:, toe] - body.joints[:, ankle]) * [1.0, 0.0, 1.0]
        middle = 0.5 * (body.joints[:, hip] + body.joints[:, ankle])
        body.joints[:, knee] = middle + _KNEE * (forward + normalize(foot))


def before(body: StandingBody, joint: int, ahead: float) -> Array:
    """Points (T, 3) of the world at `ahead` metres before a joint of the trunk, square to the trunk."""
    frames = len(body.joints)
    trunk = body.joints[:, 12] - body.joints[:, 0]
    front = np.cross(body.world(np.tile([1.0, 0.0, 0.0], (frames, 1)), LEFT), trunk)
    return body.joints[:, joint] + ahead * front / np.linalg.norm(front, axis=-1, keepdims=True)
