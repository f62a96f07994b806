"""Feet that stay where they stand, on a live stream: contact, lock and blend are decided on the past alone.

A toe that is low and slow is locked: its place on the floor stays until it is high or clearly fast. Then what it was
moved by fades along an ease curve, so nothing pops. The ankle moves with the toe, the knee follows by two-bone inverse
kinematics (`legs.py`), and a leg that grows short raises the heel.

What a clip can do and a stream cannot, since it would have to begin before the foot does: share a lock's correction out
to the swing before it, bring the hips down, lock a height that is not reached yet. So a toe is held in the floor plane
alone, the hips stay as they are, and a toe that the leg reaches no more, or that means to slide, is let go.

Streams are rows, and a chunk of one stream is cleaned frame by frame: see `live_poses.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shared.errors import InvalidInput
from shared.motion.feet import FLOOR_BAND, RELEASE, RULE, Bool, ContactRule, need_feet, over_floor
from shared.motion.kinematics import facing
from shared.motion.legs import draw_foot, foot_chain, leg_lengths, soft_stretch, two_bone_knee
from shared.motion.pose import checked_joints
from shared.motion.rotations import Array
from shared.motion.rows import Rows, choose
from shared.motion.skeleton import Skeleton

FLAT = [0, 2]  # X and Z: the floor plane
STRAY = 0.10  # metres that a lock may move a toe by; a clip, which sees where the foot ends up, allows 0.15
REACHED = 1e-6  # metres by which a held toe may miss its place
GROUND_RISE = 0.02  # m/s at which the height of standing toes is let up, so that one low frame does not count for ever


@dataclass(frozen=True, eq=False)
class FeetState(Rows):
    """What the next frame of S streams needs to know; the second axis is left and right where it is two."""

    started: Bool  # (S,) a frame went before
    places: Array  # (S, 4, 3) ankles and toes as they came in, in the order of `Skeleton.feet`
    stands: Bool  # (S, 4)
    barred: Bool  # (S, 2) let go while it was still low and slow: not locked again before it lifts
    ground: Array  # (S,) height over the floor at which a toe stands, metres
    anchor: Array  # (S, 2, 2) X and Z of a locked toe
    shift: Array  # (S, 2, 2) what the toe was moved by, X and Z
    start: Array  # (S, 2, 2) the shift at which it was let go
    age: Array  # (S, 2) seconds since then


class LiveFeet:
    """Cleans the feet of live streams of one skeleton.

    Args:
        skeleton: knows its feet, hips and legs.
        fps: frames a second.
        rule: thresholds of contact.

    Raises:
        InvalidInput: the skeleton has no feet.
    """

    def __init__(self, skeleton: Skeleton, fps: float, *, rule: ContactRule = RULE) -> None:
        need_feet(skeleton)
        self.skeleton = skeleton
        self.fps = fps
        self.rule = rule
        ankle, toe = skeleton.rest[list(skeleton.feet[:2]), 1].astype(np.float64)
        self._ankle_over_toe = ankle - toe
        self._highest_ground = max(FLOOR_BAND[1], toe)
        r_hip, l_hip = skeleton.facing[:2]
        self._chains = [foot_chain(skeleton, toe) for toe in skeleton.feet[1::2]]
        self._legs = [
            [hip, skeleton.children[hip][0], chain[-1]] for hip, chain in zip((l_hip, r_hip), self._chains, strict=True)
        ]

    def start(self, streams: int = 1) -> FeetState:
        """The state before the first frame."""
        plane = np.zeros((streams, 2, 2))
        no = np.zeros((streams, 4), bool)
        age = np.full((streams, 2), RELEASE)
        places, ground = np.zeros((streams, 4, 3)), np.zeros(streams)
        return FeetState(no[:, 0], places, no, no[:, :2], ground, plane, plane, plane, age)

    def step(self, joints: Array, state: FeetState) -> tuple[Array, Bool, FeetState]:
        """The next frame of every stream.

        Args:
            joints: (S, J, 3) metres, Y up, floor at y = 0.
            state: of the same streams in the same order; it is not changed.

        Returns:
            (S, J, 3) float64 with every bone as long as before; contacts (S, 4): L ankle, L toe, R ankle, R toe; and
            the state after them.

        Raises:
            InvalidInput: wrong shape, numbers that are not finite, or a state of other streams.
        """
        before = checked_joints(joints, self.skeleton)
        if len(state) != len(before):
            raise InvalidInput(f"{len(before)} frames for the {len(state)} streams of the state", where="live feet")
        places = before[:, list(self.skeleton.feet)]
        ground = self._ground(places, state)
        stay, enter = self._contacts(places, ground, state)
        stands = np.where(state.stands, stay, enter)
        locked, shift, start, age = self._shifts(before, places, stay, state)
        joints = before.copy()
        for side in range(2):
            self._place(side, before, joints, shift[:, side])
        barred = stay[:, 1::2] & (state.barred | (state.stands[:, 1::2] & ~locked))
        stands[:, 1::2] = locked | (enter[:, 1::2] & ~barred)
        # A toe that is locked now keeps the place where this frame puts it, its leg's reach included.
        toes = joints[:, list(self.skeleton.feet[1::2])][..., FLAT]
        anchor = np.where(locked[..., None], state.anchor, toes)
        shift = np.where(stands[:, 1::2, None], anchor - places[:, 1::2][..., FLAT], shift)
        started = np.ones(len(joints), bool)
        return joints, stands, FeetState(started, places, stands, barred, ground, anchor, shift, start, age)

    def run(self, joints: Array, state: FeetState) -> tuple[Array, Bool, FeetState]:
        """The next frames (T, J, 3) of one stream: the same, bit for bit, as T steps.

        Raises:
            InvalidInput: see `step`; the state holds more than one stream.
        """
        cleaned: list[Array] = []
        contacts: list[NDArray[np.bool_]] = []
        for frame in checked_joints(joints, self.skeleton):
            found, stands, state = self.step(frame[None], state)
            cleaned.append(found)
            contacts.append(stands)
        return np.concatenate(cleaned), np.concatenate(contacts), state

    def _ground(self, places: Array, state: FeetState) -> Array:
        """(S,) the lowest that toes have stood, rising slowly; in `FLOOR_BAND`, or up to where the T-pose has them."""
        lowest = np.clip(places[:, 1::2, 1].min(axis=1), FLOOR_BAND[0], self._highest_ground)
        return choose(state.started, np.minimum(lowest, state.ground + GROUND_RISE / self.fps), lowest)

    def _contacts(self, places: Array, ground: Array, state: FeetState) -> tuple[Bool, Bool]:
        """(S, 4) feet that stand on if they stood, and that begin to if they did not."""
        moved = np.linalg.norm(places - state.places, axis=-1) * self.fps
        speed = choose(state.started, moved, 0.0 * moved)
        over = np.array([self._ankle_over_toe, 0.0] * 2)
        low = places[..., 1] - ground[:, None] - over < np.array([self.rule.ankle_height, self.rule.toe_height] * 2)
        return low & (speed < self.rule.leave_speed), low & (speed < self.rule.enter_speed)

    def _shifts(self, joints: Array, places: Array, stay: Bool, state: FeetState) -> tuple[Bool, Array, Array, Array]:
        """Which toes are held on (S, 2), and by what toes are moved: shift, its start and its age."""
        held = state.anchor - places[:, 1::2][..., FLAT]
        locked = state.stands[:, 1::2] & stay[:, 1::2] & (np.linalg.norm(held, axis=-1) <= STRAY)
        for side in range(2):
            locked[:, side] &= self._foot(side, joints, held[:, side])[1]
        free = state.stands[:, 1::2] & ~locked
        start = np.where(free[..., None], state.shift, state.start)
        age = np.where(free, 0.0, state.age) + 1.0 / self.fps
        age = np.where(locked, RELEASE, np.minimum(age, RELEASE))
        part = age / RELEASE
        fading = start * (1.0 - part**2 * (3.0 - 2.0 * part))[..., None]
        return locked, np.where(locked[..., None], held, fading), start, age

    def _foot(self, side: int, joints: Array, shift: Array) -> tuple[Array, Bool]:
        """A foot (S, n, 3), toe first, moved in the floor plane and out of the floor as far as its leg lets it; and
        (S,) whether the leg lets its toe all the way."""
        chain, leg = self._chains[side], joints[:, self._legs[side]]
        foot = joints[:, chain].copy()
        foot[..., FLAT] += shift[:, None]
        foot[..., 1] += (over_floor(foot[:, 0, 1]) - foot[:, 0, 1])[:, None]
        was, now = np.linalg.norm(leg[:, 2] - leg[:, 0], axis=1), np.linalg.norm(foot[:, -1] - leg[:, 0], axis=1)
        thigh, shank = leg_lengths(leg)
        drawn = draw_foot(foot, leg[:, 0], soft_stretch(was, now, thigh + shank), np.ones(len(foot)))
        return drawn, np.linalg.norm(drawn[:, 0] - foot[:, 0], axis=1) < REACHED

    def _place(self, side: int, before: Array, joints: Array, shift: Array) -> None:
        """Move one foot and have its leg follow, in place."""
        leg = self._legs[side]
        joints[:, self._chains[side]] = self._foot(side, before, shift)[0]
        ahead = facing(before, self.skeleton)
        joints[:, leg[1]] = two_bone_knee(before[:, leg], before[:, leg[0]], joints[:, leg[2]], ahead)
