"""Poses at frames: the difference from the motion is added and fades before and after; feet step to their
places."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.generation.constraints.constraint_set import Keyframe
from marey.motion.curves import fades
from marey.motion.filters import smooth_above
from marey.motion.kinematics import forward_kinematics
from marey.motion.legs import MAX_DROP, follow_feet, foot_chain
from marey.motion.pose import aim_bones
from marey.motion.rotations import Array, about, conjugate, from_rotvec, multiply, to_rotvec
from marey.motion.skeleton import Skeleton
from marey.motion.stance import heading, standing_height

SHORTEST_S, LONGEST_S, PER_METRE_S = 0.4, 1.0, 2.25
"""Seconds of a fade, and seconds for each metre that a joint is away."""
STANDS = 0.06
"""Metres over the floor up to which a toe stands."""
LIFT, FULL_STEP, NO_STEP = 0.06, 0.15, 0.03
"""Metres that a step lifts a foot, metres from which on it is lifted so high, and metres without a step."""
LIFT_PER_FRAME, DROP_PER_FRAME = 0.02, 0.01


@dataclass(frozen=True, eq=False)
class BodyMotion:
    """A motion: (T, J, 4) local rotations, (T, 3) root in metres, (T, 4) contacts."""

    rotations: Array = field(repr=False)
    root: Array = field(repr=False)
    contacts: NDArray[np.bool_] = field(repr=False)

    def joints(self, skeleton: Skeleton) -> Array:
        """Return (T, J, 3) metres."""
        return forward_kinematics(skeleton, self.rotations, self.root)


def placed(key: Keyframe, posed: BodyMotion, skeleton: Skeleton) -> tuple[Array, Array]:
    """Return rotations (J, 4) and root (3,) of a keyframe; without a place of its own, it takes the place and heading
    that the motion has there."""
    if key.root is not None:
        return key.rotations, key.root
    turn = heading(posed.rotations[key.frame], skeleton) - heading(key.rotations, skeleton)
    rotations = key.rotations.copy()
    rotations[0] = multiply(about("Y", turn), rotations[0])
    root = posed.root[key.frame].copy()
    root[1] = standing_height(key.rotations, skeleton) if key.height is None else key.height
    return rotations, root


def with_poses(posed: BodyMotion, keyframes: Sequence[Keyframe], skeleton: Skeleton, fps: float) -> BodyMotion:
    """Return the motion with the poses of keyframes: the body passes into them, and the feet step to their places."""
    if not keyframes:
        return posed
    keys = sorted(keyframes, key=lambda key: key.frame)
    at = np.array([key.frame for key in keys])
    there = [placed(key, posed, skeleton) for key in keys]
    wanted, roots = np.stack([rotations for rotations, _ in there]), np.stack([root for _, root in there])
    turns = to_rotvec(multiply(wanted, conjugate(posed.rotations[at])))
    joints, targets = posed.joints(skeleton), forward_kinematics(skeleton, wanted, roots)
    apart = np.linalg.norm(targets - joints[at], axis=-1).max(axis=1)
    spans = np.clip(PER_METRE_S * apart, SHORTEST_S, LONGEST_S) * fps
    count = len(posed.root)
    moves = np.concatenate([turns.reshape(len(at), -1), roots - posed.root[at]], axis=1)
    whole = fades(at, moves, spans, count)
    rotations = multiply(from_rotvec(whole[:, :-3].reshape(count, -1, 3)), posed.rotations)
    passed = BodyMotion(
        rotations, over_the_floor(rotations, posed.root + whole[:, -3:], at, skeleton, fps), posed.contacts
    )
    before = passed.joints(skeleton)
    moved, contacts = before.copy(), posed.contacts.copy()
    for side in range(2):
        chain = foot_chain(skeleton, skeleton.feet[2 * side + 1])
        feet = Steps(joints[:, chain].copy(), contacts[:, 2 * side : 2 * side + 2].copy())
        for k, frame in enumerate(at):
            first = posed.contacts[max(frame - round(spans[k]), 0), 1]  # the foot that is in the air steps first
            feet.step(int(frame), targets[k][chain], spans[k], late=bool(first) == (side == 0))
        moved[:, chain] = np.where(feet.used[:, None, None], feet.places, before[:, chain])
        contacts[:, 2 * side : 2 * side + 2] = feet.contacts
    near = np.abs(np.arange(count)[:, None] - at).min(axis=1)
    most_drop = np.minimum(DROP_PER_FRAME * near, MAX_DROP)
    follow_feet(before, moved, contacts[:, 1::2], skeleton, fps, most_drop=most_drop)
    return BodyMotion(aim_bones(moved, rotations, skeleton), moved[:, 0], contacts)


def over_the_floor(rotations: Array, root: Array, at: NDArray[np.intp], skeleton: Skeleton, fps: float) -> Array:
    """Return the root (T, 3), lifted where a body on the way to a pose would pass through the floor."""
    lowest = forward_kinematics(skeleton, rotations, root)[..., 1].min(axis=1)
    lowest[at] = 0.0
    lift = smooth_above(np.maximum(-lowest, 0.0), 0.04 * fps)
    near = np.abs(np.arange(len(root))[:, None] - at).min(axis=1)
    return root + np.minimum(lift, LIFT_PER_FRAME * near)[:, None] * [0.0, 1.0, 0.0]


class Steps:
    """One foot that steps to its places in poses, stands there, and steps back.

    Attributes:
        places: (T, n, 3) the foot, toe first, metres.
        contacts: (T, 2) of ankle and toe.
        used: (T,) True where the foot's places count, and not those that the body would give it.
    """

    def __init__(self, places: Array, contacts: NDArray[np.bool_]) -> None:
        self.places, self.contacts = places, contacts
        self.used = np.zeros(len(places), np.bool_)

    def step(self, frame: int, there: Array, span: float, *, late: bool) -> None:
        """Let the foot stand at its place (n, 3) in the pose of a frame; in a pose it may be in the air.

        Args:
            span: frames before and after it in which it steps, in one half of them.
            late: it steps after the other foot.
        """
        stands = there[0, 1] < STANDS
        half = max(span / 2, 2.0)
        for way in (-1, 1):
            edge = frame + way * half if late else frame + 2 * way * half  # where the step begins, or ends behind it
            frames = np.arange(len(self.places))
            beyond = (frames - frame) * way
            inside = (beyond >= (way > 0)) & (beyond <= 2 * half)
            share = np.clip((abs(edge - frame) - beyond) / half, 0.0, 1.0)[inside]  # 1 = in the pose
            weight = share**3 * (share * (share * 6 - 15) + 10)
            far = np.linalg.norm((self.places[inside][:, 0] - there[0])[:, [0, 2]], axis=1)
            lift = LIFT * np.minimum(far / FULL_STEP, 1.0) * 16 * (share * (1 - share)) ** 2
            places = (1 - weight)[:, None, None] * self.places[inside] + weight[:, None, None] * there
            places[..., 1] += lift[:, None]
            self.places[inside] = places
            moving = (share > 0) & (share < 1) & (far > NO_STEP)
            own = self.contacts[inside] & (share < 1)[:, None]
            self.contacts[inside] = (own | ((share == 1) & stands)[:, None]) & ~moving[:, None]
            self.used |= inside
