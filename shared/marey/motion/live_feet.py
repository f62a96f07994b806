"""Foot locking on a live stream: contact, lock and blend depend on past frames alone.

A toe that is low and slow is locked: it keeps its place on the floor until it is high or clearly moving. Then the
displacement fades along an ease curve, so nothing jumps. The ankle moves with the toe, the knee follows by two-bone
inverse kinematics (`legs.py`), and a leg that becomes too short raises the heel.

A stream cannot do three things that a clip can, since they would have to begin before the foot does: share a lock's
correction with the swing before it, bring the hips down, lock a height that is not reached yet. So a toe is held in the
floor plane alone, the hips stay, and a toe that the leg no longer reaches, or that slides on purpose, is released.

Streams are rows, and a chunk of one stream is cleaned frame by frame: see `live_poses.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.feet import FLOOR_BAND, RELEASE, RULE, Bool, ContactRule, need_feet, over_floor
from marey.motion.kinematics import facing
from marey.motion.legs import draw_foot, foot_chain, leg_lengths, soft_stretch, two_bone_knee
from marey.motion.pose import checked_joints
from marey.motion.rotations import Array, length
from marey.motion.rows import Rows
from marey.motion.skeleton import Skeleton

FLAT = slice(0, 3, 2)  # X and Z: the floor plane
TOES = slice(1, 4, 2)  # of ankles and toes in the order of `Skeleton.feet`
STRAY = 0.10  # metres that a lock may move a toe; a clip, whose later frames are known, allows 0.15
REACHED = 1e-6  # metres of tolerance between a held toe and its place
GROUND_RISE = 0.02  # m/s at which the standing height of toes may rise, so that one low frame is forgotten


@dataclass(frozen=True, eq=False)
class FeetState(Rows):
    """State carried between frames of S streams; an axis of length two is left, right."""

    started: Bool  # (S,) there is an earlier frame
    places: Array  # (S, 4, 3) input positions of ankles and toes, in the order of `Skeleton.feet`, metres
    stands: Bool  # (S, 4)
    barred: Bool  # (S, 2) released while still low and slow: not locked again before it lifts
    ground: Array  # (S,) height over the floor at which a toe stands, metres
    anchor: Array  # (S, 2, 2) X and Z of a locked toe
    shift: Array  # (S, 2, 2) displacement of the toe, X and Z
    start: Array  # (S, 2, 2) the shift at which it was released
    age: Array  # (S, 2) seconds since then


class LiveFeet:
    """Cleans the feet of live streams of one skeleton.

    Args:
        skeleton: must have feet, hips and legs.
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
        self._over_toe = np.array([ankle - toe, 0.0] * 2)  # (4,) heights in the T-pose, metres
        self._low = np.array([rule.ankle_height, rule.toe_height] * 2)  # (4,)
        self._highest_ground = max(FLOOR_BAND[1], toe)
        self._feet = np.array(skeleton.feet)
        # Left and right are rows of one array: (2, n) toe, …, ankle, and (2, 3) hip, knee, ankle.
        self._chains = np.array([foot_chain(skeleton, toe) for toe in skeleton.feet[TOES]])
        hips = skeleton.facing[1::-1]
        self._legs = np.array(
            [[hip, skeleton.children[hip][0], chain[-1]] for hip, chain in zip(hips, self._chains, strict=True)]
        )

    def start(self, streams: int = 1) -> FeetState:
        """Return the state before the first frame."""
        plane = np.zeros((streams, 2, 2))
        no = np.zeros((streams, 4), bool)
        age = np.full((streams, 2), RELEASE)
        places, ground = np.zeros((streams, 4, 3)), np.zeros(streams)
        return FeetState(no[:, 0], places, no, no[:, :2], ground, plane, plane, plane, age)

    def step(self, joints: Array, state: FeetState) -> tuple[Array, Bool, FeetState]:
        """Return the next frame of every stream.

        Args:
            joints: (S, J, 3) metres, Y up, floor at y = 0.
            state: of the same streams in the same order; it is not changed.

        Returns:
            (S, J, 3) float64 in metres, with unchanged bone lengths; contacts (S, 4): L ankle, L toe, R ankle, R toe;
            and the state after them.

        Raises:
            InvalidInput: wrong shape, numbers that are not finite, or a state of other streams.
        """
        before = checked_joints(joints, self.skeleton)
        if len(state) != len(before):
            raise InvalidInput(f"{len(before)} frames for the {len(state)} streams of the state", where="live feet")
        places = before.take(self._feet, 1)
        toes = places[:, TOES, FLAT]
        ground = self._ground(places, state)
        stay, enter = self._contacts(places, ground, state)
        stood, stands = state.stands[:, TOES], np.where(state.stands, stay, enter)
        held = state.anchor - toes
        fading, start, age = self._release(state)
        locked, feet = self._lock(before, stood & stay[:, TOES], held, fading)
        barred = stay[:, TOES] & (state.barred | (stood & ~locked))
        stands[:, TOES] = locked | (enter[:, TOES] & ~barred)
        # A newly locked toe keeps the place of this frame, limited by its leg's reach.
        hold = locked[..., None]
        anchor = np.where(hold, state.anchor, feet[:, :, 0, FLAT])
        shift = np.where(stands[:, TOES, None], anchor - toes, np.where(hold, held, fading))
        start, age = np.where(hold, state.start, start), np.where(locked, RELEASE, age)
        started = np.ones(len(before), bool)
        state = FeetState(started, places, stands, barred, ground, anchor, shift, start, age)
        return self._with_feet(before, feet), stands, state

    def run(self, joints: Array, state: FeetState) -> tuple[Array, Bool, FeetState]:
        """Return the next frames (T, J, 3) of one stream: the same, bit for bit, as T calls of `step`.

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
        """Return the lowest standing height of toes (S,), rising slowly; in `FLOOR_BAND`, or up to that of the
        T-pose."""
        lower = np.minimum(places[:, 1, 1], places[:, 3, 1])
        lowest = np.minimum(np.maximum(lower, FLOOR_BAND[0]), self._highest_ground)
        return np.where(state.started, np.minimum(lowest, state.ground + GROUND_RISE / self.fps), lowest)

    def _contacts(self, places: Array, ground: Array, state: FeetState) -> tuple[Bool, Bool]:
        """Return the feet (S, 4) that continue to stand, and those that begin to."""
        speed = np.where(state.started[:, None], length(places - state.places) * self.fps, 0.0)
        low = places[..., 1] - ground[:, None] - self._over_toe < self._low
        return low & (speed < self.rule.leave_speed), low & (speed < self.rule.enter_speed)

    def _release(self, state: FeetState) -> tuple[Array, Array, Array]:
        """Return offsets of toes that are not locked (S, 2, 2), the offsets they fade from (S, 2, 2), and the times
        since release in seconds."""
        stood = state.stands[:, TOES]
        start = np.where(stood[..., None], state.shift, state.start)
        age = np.minimum(np.where(stood, 0.0, state.age) + 1.0 / self.fps, RELEASE)
        part = age / RELEASE
        return start * (1.0 - part * part * (3.0 - 2.0 * part))[..., None], start, age

    def _lock(self, joints: Array, may: Bool, held: Array, fading: Array) -> tuple[Bool, Array]:
        """Return the toes that stay locked (S, 2), and feet (S, 2, n, 3), toe first, locked or released.

        Args:
            joints: (S, J, 3) input positions, metres.
            may: (S, 2) toes that were held and are still low and slow.
            held, fading: (S, 2, 2) displacement of a toe, X and Z, if it is held and if it is not.
        """
        feet, reached = self._moved(joints, np.array([held, fading]))
        locked: Bool = may & (length(held) <= STRAY) & reached[0]
        free: Array = feet[1]
        return locked, np.where(locked[..., None, None], feet[0], free)

    def _moved(self, joints: Array, shifts: Array) -> tuple[Array, Bool]:
        """Return feet (W, S, 2, n, 3), toe first, moved in W ways in the floor plane and out of the floor as far as
        their legs reach; and (W, S, 2) True where the legs reach all the way.

        Args:
            joints: (S, J, 3).
            shifts: (W, S, 2, 2) X and Z.
        """
        legs = joints.take(self._legs, 1)
        hips, ankles = legs[:, :, 0], legs[:, :, 2]
        feet = np.repeat(joints.take(self._chains, 1)[None], len(shifts), axis=0)
        feet[..., FLAT] += shifts[..., None, :]
        height = feet[..., :1, 1]
        feet[..., 1] += over_floor(height) - height
        thigh, shank = leg_lengths(legs)
        wanted = soft_stretch(length(ankles - hips), length(feet[..., -1, :] - hips), thigh + shank)
        drawn = draw_foot(feet, hips[None], wanted, np.ones(wanted.shape))
        return drawn, length(drawn[..., 0, :] - feet[..., 0, :]) < REACHED

    def _with_feet(self, before: Array, feet: Array) -> Array:
        """Return joints (S, J, 3) with the moved feet (S, 2, n, 3), and knees that follow."""
        legs, ankles = before.take(self._legs, 1), feet[:, :, -1]
        joints = before.copy()
        joints[:, self._chains] = feet
        ahead = facing(before, self.skeleton)[:, None]
        joints[:, self._legs[:, 1]] = two_bone_knee(legs, legs[:, :, 0], ankles, ahead)
        return joints
