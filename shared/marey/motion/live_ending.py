"""The end of a live stream: its last frames pass into a pose, at the place and heading that the body has then."""

from __future__ import annotations

import numpy as np

from marey.motion.filters import smoothstep
from marey.motion.rotations import Array, about, multiply, slerp
from marey.motion.skeleton import Skeleton
from marey.motion.stance import heading, standing_height


class LiveEnding:
    """Passes of a body into a pose, frame by frame.

    Args:
        skeleton: of the frames.
        rotations: (J, 4) of the pose, local unit quaternions.
        height: of its root, metres; None = it stands on the floor.
        first: number of the first frame that is changed.
        frames: frames until the pose is reached, 1 or more.

    Attributes:
        last: number of the frame that has the pose.
    """

    def __init__(self, skeleton: Skeleton, rotations: Array, height: float | None, first: int, frames: int) -> None:
        self.last = first + frames - 1
        self._first, self._frames = first, frames
        self._skeleton = skeleton
        self._rotations = np.asarray(rotations, np.float64)
        self._heading = heading(self._rotations, skeleton)
        self._height = standing_height(self._rotations, skeleton) if height is None else height

    def passed(self, number: int, rotations: Array, root: Array) -> tuple[Array, Array]:
        """Return rotations (J, 4) and root (3,) of a frame on its way to the pose.

        Args:
            number: of the frame.
            rotations: of the frame, (J, 4).
            root: of the frame, metres.
        """
        share = min((number - self._first + 1) / self._frames, 1.0)
        weight = smoothstep(np.array(share))
        turned = np.asarray(rotations, np.float64)
        there = self._rotations.copy()
        there[0] = multiply(about("Y", heading(turned, self._skeleton) - self._heading), there[0])
        place = np.asarray(root, np.float64).copy()
        place[1] += float(weight) * (self._height - place[1])
        return slerp(turned, there, weight), place
