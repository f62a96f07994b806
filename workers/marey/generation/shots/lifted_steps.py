"""Steps in transitions: a foot that a network pushes over the floor to its next place is lifted there.

Between two movements a network brings the trailing foot of a walk beside the other one, and the feet of one posture to
those of the next. It often does so with the sole on the floor, at two metres a second. Such a foot keeps its way and
its time, and goes there in an arc.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.generation.shots.flowing import LIFT_M
from marey.generation.shots.windows import CROSSFADE
from marey.motion.features import HeadingLayout
from marey.motion.feet import runs
from marey.motion.filters import smooth
from marey.motion.kinematics import facing
from marey.motion.legs import two_bone_knee
from marey.posing.limbs import LEVEL
from marey.posing.standing import LEGS

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

MOVES_M_S, FAR_M = 0.25, 0.08
"""Metres a second from which a toe moves over the floor, and metres of a way in which it is lifted."""
LIFT_SHARE = 0.25
"""Share of its way by which a foot is lifted on a short one."""
STEPS_M = 0.033
"""Metres over the floor of a foot that steps by itself, on the average of its way."""
PASSES_S = 0.04
"""Standard deviation of the filter of the arc, seconds."""


def with_steps(features: Float32, layout: HeadingLayout, spans: Sequence[tuple[int, int]]) -> Float32:
    """Return features (T, D) whose feet step where they slid.

    Args:
        features: of the whole, in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        spans: the first frame of each transition, and the one after its last.
    """
    joints = layout.decode(features).astype(np.float64)
    stepped = joints.copy()
    for begin, end in spans:
        for side, first, last in _slides(joints, layout.fps, begin, end):
            _lift(stepped, side, first, last, layout.fps)
    moved = stepped - joints
    if not moved.any():
        return features
    ahead = facing(joints, layout.skeleton)
    for hip, knee, ankle, _ in LEGS.values():
        raised = moved[:, ankle].any(axis=1)
        leg = joints[raised][:, [hip, knee, ankle]]
        moved[raised, knee] = two_bone_knee(leg, leg[:, 0], stepped[raised, ankle], ahead[raised]) - leg[:, 1]
    return layout.move_joints(features, moved)


def _slides(joints: Array, fps: float, begin: int, end: int) -> Iterator[tuple[str, int, int]]:
    """Yield the side of each foot that goes elsewhere on the floor between the frames `begin` and `end`, the first
    frame of its way, and the one after its last; while it goes, the other one is slower, and stands."""
    toes = np.stack([joints[:, toe] for *_, toe in LEGS.values()])
    floor = float(toes[:, begin:end, 1].min())
    speeds = np.linalg.norm(np.gradient(toes * LEVEL, axis=1), axis=-1) * fps
    for number, side in enumerate(LEGS):
        moves = (speeds[number] > MOVES_M_S) & (speeds[number] > speeds[1 - number])
        for first, last in runs(moves):
            far = float(np.linalg.norm((toes[number, last - 1] - toes[number, first]) * LEVEL))
            carried = float(np.average(toes[number, first:last, 1], weights=speeds[number, first:last])) - floor
            if begin <= (first + last) // 2 < end + CROSSFADE and far > FAR_M and carried < STEPS_M:
                yield side, first, last


def _lift(joints: Array, side: str, first: int, last: int, fps: float) -> None:
    """Lift a foot on its way from frame `first` to the one before `last`, in place."""
    *_, ankle, toe = LEGS[side]
    way = np.linalg.norm(np.diff(joints[:, toe] * LEVEL, axis=0, prepend=joints[:1, toe] * LEVEL), axis=1)
    way[: first + 1], way[last:] = 0.0, 0.0
    far = way.sum()
    rises = min(LIFT_M, LIFT_SHARE * far) * np.sin(np.pi * np.cumsum(way) / far)
    arc = smooth(rises[:, None], PASSES_S * fps)
    joints[:, [ankle, toe], 1] += arc
