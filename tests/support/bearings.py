"""Bodies on which bearings are drawn."""

from __future__ import annotations

import numpy as np

from marey.generation.bearing import BorneSpan
from marey.generation.bearing_drawing import borne
from marey.generation.port import MotionFeatures
from marey.motion.features import HUMANML3D_263
from marey.motion.skeleton import HUMANML3D
from marey.vocabulary.bearings import StatedBearing
from tests.support.bodies import Body

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, HEAD, NECK = 0, 15, 12
SHOULDERS, WRISTS, TOES = [16, 17], [20, 21], [10, 11]
CONTACTS = [list(HUMANML3D.feet).index(toe) for toe in TOES]


class OnceMade:
    """A motion of a model."""

    def __init__(self, joints: np.ndarray) -> None:
        self.features = LAYOUT.encode(joints)


def drawn(
    joints: np.ndarray, *stated: StatedBearing, begin: int = 0, end: int | None = None, action: str = "walk"
) -> np.ndarray:
    """Return the joints of a motion with bearings from `begin` on; the toes are where they were in frame 0."""
    made: MotionFeatures = OnceMade(joints)
    spans = [BorneSpan(begin, len(made.features) if end is None else end, stated, action, seed=3)]
    joints = LAYOUT.decode(borne(made, LAYOUT, spans)).astype(np.float64)
    return joints - joints[:1, TOES].mean(1, keepdims=True) * [1, 0, 1]


def standing(seconds: float = 4.0) -> np.ndarray:
    return Body(seconds).joints()


def named(name: str, side: str = "") -> StatedBearing:
    return StatedBearing(name, side)  # type: ignore[arg-type]


def pitch(joints: np.ndarray) -> np.ndarray:
    """Return degrees (T,) by which the trunk leans forward, of a body that faces +Z."""
    trunk = joints[:, NECK] - joints[:, PELVIS]
    return np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
