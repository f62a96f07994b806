"""Decode features on a live stream: yaw and root are accumulated frame by frame in a carried state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.features import Float32, HeadingLayout, to_world
from marey.motion.rotations import Array
from marey.motion.rows import Rows


@dataclass(frozen=True, eq=False)
class RootState(Rows):
    """Root yaw and position of S streams. All zeros before the first frame, which faces +Z over the origin."""

    half_yaw: Array  # (S,) radians, of the last frame
    place: Array  # (S, 2) X and Z of its root, in units of the features
    step: Array  # (S, 3) its step to the next frame: half yaw step, velocity X and Z


class LiveDecoder:
    """Decodes frames of live streams: the same joints as `layout.decode` of all frames at once, to rounding.

    Args:
        layout: layout of the features.
    """

    def __init__(self, layout: HeadingLayout) -> None:
        self.layout = layout

    def start(self, streams: int = 1) -> RootState:
        """Return the state before the first frame."""
        return RootState(np.zeros(streams), np.zeros((streams, 2)), np.zeros((streams, 3)))

    def step(self, features: Array, state: RootState) -> tuple[Float32, RootState]:
        """Return the next frame of every stream.

        Args:
            features: (S, D), not normalized.
            state: of the same streams in the same order; it is not changed.

        Returns:
            Joints (S, J, 3) in metres, and the state after them.

        Raises:
            InvalidInput: wrong shape, or a state of other streams.
        """
        if features.ndim != 2 or features.shape != (len(state), self.layout.dim):
            wanted = f"({len(state)}, {self.layout.dim})"
            raise InvalidInput(f"features have shape {features.shape}, not {wanted}", where=self.layout.name)
        values = np.asarray(features[:, :4], np.float64)
        half_yaw = state.half_yaw + state.step[:, 0]
        place = state.place + to_world(half_yaw, state.step[:, 1:])
        root = np.stack([place[:, 0], values[:, 3], place[:, 1]], axis=1) * self.layout.unit
        return self.layout.place_joints(features, half_yaw, root), RootState(half_yaw, place, values[:, :3])

    def follow(self, features: Array, state: RootState) -> RootState:
        """Return the state of one stream after its next frames (T, D), T at least 1: that of T calls of `step`, to
        rounding, without their joints and in a hundredth of the time.

        Raises:
            InvalidInput: see `run`.
        """
        self._check_run(features, state)
        values = np.asarray(features[:, :3], np.float64)
        steps = np.concatenate([state.step, values[:-1]])  # (T, 3) step of the frame before each
        half_yaw = np.cumsum(np.concatenate([state.half_yaw, steps[:, 0]]))[1:]  # (T,)
        place = state.place + to_world(half_yaw, steps[:, 1:]).sum(axis=0)
        return RootState(half_yaw[-1:], place, values[-1:])

    def run(self, features: Array, state: RootState) -> tuple[Float32, RootState]:
        """Return the next frames (T, D) of one stream, T at least 1: the same, bit for bit, as T calls of `step`.

        Raises:
            InvalidInput: see `step`; no frames; the state holds more than one stream.
        """
        self._check_run(features, state)
        joints: list[Float32] = []
        for frame in features:
            found, state = self.step(frame[None], state)
            joints.append(found)
        return np.concatenate(joints), state

    def _check_run(self, features: Array, state: RootState) -> None:
        if features.ndim != 2 or not len(features) or features.shape[1] != self.layout.dim:
            wanted = f"(T >= 1, {self.layout.dim})"
            raise InvalidInput(f"features have shape {features.shape}, not {wanted}", where=self.layout.name)
        if len(state) != 1:
            raise InvalidInput(f"a state of {len(state)} streams, not of one", where=self.layout.name)
