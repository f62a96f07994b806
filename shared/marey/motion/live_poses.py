"""Pose solver for live streams: the rotations of a frame depend on that frame and the past alone.

Each frame is solved by the same closed forms as a clip (`solver.py`), with the same accuracy. Decisions that a clip
takes from frames on both sides in time are taken here from a carried state:

- the bend plane that frames show of a limb runs through an exponential mean, so that a straight limb keeps its plane
and
  drifts to the neutral one; a critically damped spring brings the twist there without a jump. Only the twist about the
  bone lags (by 0.15 s), never the position of a joint;
- a spine twisted past half a turn, which no body does, continues without a jump and returns within some seconds;
- signs follow the frame before.

Streams are rows: one call takes a frame of each of any number of streams. A chunk of one stream is solved frame by
frame, so the size of chunks changes no bit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.pose import PLANE_PRIOR, Pose, checked_joints
from marey.motion.rotations import Array, dot
from marey.motion.rows import Rows
from marey.motion.skeleton import Skeleton
from marey.motion.solver import FrameSolver

SEEN_SECONDS = 0.05  # time constant of the mean of observed bend planes
SPRING = 20.0  # 1/s; at 40 a limb that bends again turns by 50 degrees a frame at 20 fps, at 20 by 30
UNTWIST_SECONDS = 1.0  # time constant in which a surplus full turn fades


@dataclass(frozen=True, eq=False)
class PoseState(Rows):
    """State carried between frames of S streams, with L limbs, C spines, J joints."""

    started: NDArray[np.bool_]  # (S,) there is an earlier frame
    seen: Array  # (S, L, 2) mean of the observed bend planes
    angle: Array  # (S, L) twist of the bend planes, radians
    speed: Array  # (S, L) its rate, radians a second
    twist: Array  # (S, C) of the spines, -pi to pi
    turns: Array  # (S, C) full turns added to it, so that there is no jump
    rotations: Array  # (S, J, 4) the frame before


class LivePoses:
    """Solves frames of live streams of one skeleton.

    Args:
        skeleton: with the bone lengths of the body (`measure_offsets`); they never change.
        fps: frames a second.
    """

    def __init__(self, skeleton: Skeleton, fps: float) -> None:
        self.skeleton = skeleton
        self.fps = fps
        self._solver = FrameSolver(skeleton)

    def start(self, streams: int = 1) -> PoseState:
        """Return the state before the first frame."""
        limbs, chains = len(self._solver.limbs), len(self._solver.spines)
        return PoseState(
            np.zeros(streams, bool),
            np.zeros((streams, limbs, 2)),
            np.zeros((streams, limbs)),
            np.zeros((streams, limbs)),
            np.zeros((streams, chains)),
            np.zeros((streams, chains)),
            np.zeros((streams, len(self.skeleton), 4)),
        )

    def step(self, joints: Array, state: PoseState) -> tuple[Pose, PoseState]:
        """Return the next frame of every stream.

        Args:
            joints: (S, J, 3) metres.
            state: of the same streams in the same order; it is not changed.

        Returns:
            A pose whose first axis is the streams, and the state after it.

        Raises:
            InvalidInput: wrong shape, numbers that are not finite, or a state of other streams.
        """
        joints = checked_joints(joints, self.skeleton)
        if len(state) != len(joints):
            raise InvalidInput(f"{len(joints)} frames for the {len(state)} streams of the state", where="live poses")
        past = _Past(state, self.fps)
        local, places = self._solver.solve(joints, past)
        # Signs follow the frame before; in a first one, w is positive.
        behind = np.where(state.started[:, None], dot(local, state.rotations), local[..., 0]) < 0
        local = np.where(behind[..., None], -local, local)
        return Pose(self.skeleton, local, joints[:, 0].copy(), places), past.after(local)

    def places(self, joints: Array) -> Array:
        """Return the joint positions (S, J, 3) that `step` would give, without state and in a fraction of its time.

        Raises:
            InvalidInput: wrong shape, or numbers that are not finite.
        """
        return self._solver.places(checked_joints(joints, self.skeleton))

    def run(self, joints: Array, state: PoseState) -> tuple[Pose, PoseState]:
        """Return the next frames (T, J, 3) of one stream: the same, bit for bit, as T calls of `step`.

        Raises:
            InvalidInput: see `step`; the state holds more than one stream.
        """
        joints = checked_joints(joints, self.skeleton)
        poses: list[Pose] = []
        for frame in joints:
            pose, state = self.step(frame[None], state)
            poses.append(pose)
        rotations, root = np.concatenate([p.rotations for p in poses]), np.concatenate([p.root for p in poses])
        return Pose(self.skeleton, rotations, root, np.concatenate([p.joints for p in poses])), state


class _Past:
    """Moments of one frame per stream: resolved from the state of the past frames."""

    def __init__(self, state: PoseState, fps: float) -> None:
        self.state = state
        self.seconds = 1.0 / fps
        # In a first frame the past has no weight.
        keep = np.where(state.started, math.exp(-self.seconds / SEEN_SECONDS), 0.0)  # (S,)
        self.decay = np.where(state.started, math.exp(-SPRING * self.seconds), 0.0)  # (S,)
        self.unwound = np.where(state.started, math.exp(-self.seconds / UNTWIST_SECONDS), 0.0)  # (S,)
        self.fresh = (1.0 - keep)[:, None]  # (S, 1)
        self.seen = keep[:, None, None] * state.seen  # the part of the past; `bend` adds that of this frame
        self.angle, self.speed = state.angle.copy(), state.speed.copy()
        self.turned, self.turns = state.twist.copy(), state.turns.copy()

    def after(self, rotations: Array) -> PoseState:
        """Return the state after this frame."""
        started = np.ones(len(rotations), bool)
        return PoseState(started, self.seen, self.angle, self.speed, self.turned, self.turns, rotations)

    def signs(self, q: Array) -> Array:
        return np.where(q[..., :1] < 0, -q, q)

    def bend(self, limb: int, seen: Array) -> Array:
        mean = self.seen[:, limb] + self.fresh * seen
        aim = np.arctan2(mean[:, 1], mean[:, 0] + PLANE_PRIOR)
        # The exact motion of a critically damped spring over one frame, on the circle: in the shorter direction.
        off, speed = _principal(self.state.angle[:, limb] - aim), self.state.speed[:, limb]
        push = (speed + SPRING * off) * self.seconds
        angle = _principal(aim + (off + push) * self.decay)
        self.seen[:, limb], self.angle[:, limb] = mean, angle
        self.speed[:, limb] = (speed - SPRING * push) * self.decay
        return angle

    def twist(self, chain: int, angles: Array) -> Array:
        now = _principal(angles)
        passed = 2 * np.pi * np.rint((self.state.twist[:, chain] - now) / (2 * np.pi))
        self.turned[:, chain] = now
        self.turns[:, chain] = self.unwound * (self.state.turns[:, chain] + passed)
        return now + self.turns[:, chain]


def _principal(angles: Array) -> Array:
    """Wrap angles to -pi to pi."""
    return angles - 2 * np.pi * np.rint(angles / (2 * np.pi))
