"""Quality of a clip in memory."""

from __future__ import annotations

from marey.motion.clip import MotionClip
from marey.motion.skeleton import HUMANML3D
from marey.quality.limits import Expected, assess
from marey.quality.measure import SHORTEST
from marey.quality.record import MotionQuality


def quality_of(clip: MotionClip, expected: Expected) -> MotionQuality | None:
    """Measure and judge a clip; None on other skeletons than that of 22 joints, and under 4 frames."""
    if clip.skeleton.name != HUMANML3D.name or clip.frames < SHORTEST:
        return None
    return assess(clip.joints, clip.fps, expected)
