"""Finish live frames one by one: decode, fit the bones, lock the feet, solve.

The live form of `finish.py`, at the layout's own rate, on the bundle's standard body. Bones of a decoder change a
little from frame to frame; joints are first put where the solver would put them, on bones of the body's lengths, and
then the feet are locked: locked feet stay in place when the pose is solved.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from marey.motion.body import standard_body, travel_scale
from marey.motion.bones import bone_fit
from marey.motion.features import Float32, HeadingLayout
from marey.motion.feet import Bool, need_feet
from marey.motion.live_features import LiveDecoder, RootState
from marey.motion.live_feet import FeetState, LiveFeet
from marey.motion.live_poses import LivePoses, PoseState
from marey.motion.pose import checked_joints
from marey.motion.rotations import Array
from marey.motion.rows import Rows

MEMORY = 40
"""Frames after which poses and feet no longer depend on their start."""


@dataclass(frozen=True, eq=False)
class LiveState(Rows):
    """State carried between frames of S streams."""

    root: RootState
    feet: FeetState
    poses: PoseState


@dataclass(frozen=True, eq=False)
class LiveFrames:
    """One frame of each of S streams.

    Attributes:
        rotations: (S, J, 4) local unit quaternions, continuous in sign from frame to frame.
        root: (S, 3) metres.
        joints: (S, J, 3) metres, the forward kinematics of the above.
        contacts: (S, 4) bool: L ankle, L toe, R ankle, R toe stand.
    """

    rotations: Float32 = field(repr=False)
    root: Float32 = field(repr=False)
    joints: Float32 = field(repr=False)
    contacts: Bool = field(repr=False)


class LiveMotion:
    """Finishes frames of live streams.

    Args:
        layout: layout of the features.

    Attributes:
        skeleton: of the standard body; clients receive it once.

    Raises:
        InvalidInput: the skeleton has no feet.
    """

    def __init__(self, layout: HeadingLayout) -> None:
        need_feet(layout.skeleton)
        self.layout = layout
        self.skeleton = standard_body(layout.skeleton).skeleton
        self._decoder = LiveDecoder(layout)
        self._bones = bone_fit(layout.skeleton)
        self._scale = travel_scale(layout.skeleton, self.skeleton)
        self._poses = LivePoses(self.skeleton, layout.fps)
        self._feet = LiveFeet(self.skeleton, layout.fps)

    def start(self, streams: int = 1) -> LiveState:
        """Return the state before the first frame."""
        return LiveState(self._decoder.start(streams), self._feet.start(streams), self._poses.start(streams))

    def after(self, features: Array) -> LiveState:
        """Return the state of one stream after its earlier frames (T, D), T at least 1.

        The root is followed through all of them; poses and feet, which forget, through the last `MEMORY` frames alone.
        """
        state = self.start()
        early, late = features[:-MEMORY], features[-MEMORY:]
        if len(early):
            state = replace(state, root=self._decoder.follow(early, state.root))
        for frame in late:
            _, state = self.step(frame[None], state)
        return state

    def step(self, features: Array, state: LiveState) -> tuple[LiveFrames, LiveState]:
        """Return the next frame of every stream.

        Args:
            features: (S, D), not normalized.
            state: of the same streams in the same order; it is not changed.

        Raises:
            InvalidInput: wrong shape, numbers that are not finite, or a state of other streams.
        """
        decoded, root = self._decoder.step(features, state.root)
        fitted = self._scale * self._bones.fit(checked_joints(decoded, self.skeleton))
        joints, contacts, feet = self._feet.step(self._poses.places(fitted), state.feet)
        pose, poses = self._poses.step(joints, state.poses)
        rotations, place, places = (
            np.ascontiguousarray(values, np.float32) for values in (pose.rotations, pose.root, pose.joints)
        )
        return LiveFrames(rotations, place, places, contacts), LiveState(root, feet, poses)
