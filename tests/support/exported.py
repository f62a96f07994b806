"""Clips to open in other programs."""

from __future__ import annotations

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.rotations import from_rotvec
from marey.motion.skeleton import KIT, SNAPMOGEN, Skeleton
from tests.support.walker import walker


def tumbling(skeleton: Skeleton, fps: float) -> MotionClip:
    """Every joint turns any way, past the gimbal lock and through whole turns: no pose a body can take."""
    random = np.random.default_rng(5)
    time = np.arange(40)[:, None, None] / 20
    vectors = random.normal(0, 2.5, (1, len(skeleton), 3)) * np.sin(time * random.uniform(1, 4, (1, len(skeleton), 3)))
    root = random.normal(0, 1, (40, 3)).cumsum(axis=0)
    return MotionClip.of(skeleton, from_rotvec(vectors), root, np.zeros((40, 4), bool), fps)


def finished(fps: float) -> MotionClip:
    """The way of a generated motion: features, decoded, cleaned, solved and resampled."""
    return finish_motion(HUMANML3D_263.encode(walker(turn=0.5).joints), HUMANML3D_263, fps=fps)


CLIPS = {
    "a finished motion at 20 fps": finished(20),
    "a finished motion at 59.94 fps": finished(60000 / 1001),
    "a walk": walker(turn=0.7),
    "a walk at 23.976 fps": walker(fps=24000 / 1001),
    "a walk at 120 fps": walker(seconds=1, fps=120, turn=-1.5),
    "tumbling KIT joints": tumbling(KIT, 12.5),
    "tumbling SnapMoGen joints": tumbling(SNAPMOGEN, 30),
}

RATES = {"24": 24.0, "25": 25.0, "30": 30.0, "60": 60.0, "23.976": 24000 / 1001}
LONG = {f"10 s at {name} fps": walker(seconds=10, fps=fps, turn=0.3) for name, fps in RATES.items()}
"""Walks at the rates that studios ask for, long enough that an error of time would grow to more than a millimetre."""
