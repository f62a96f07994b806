"""Steps in transitions: a foot that a network pushes over the floor to its next place is lifted there.

Between two movements a network brings the trailing foot of a walk beside the other one, and the feet of one posture to
those of the next. It often does so with the sole on the floor, at two metres a second. Such a foot keeps its way and
its time, and goes there in an arc.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from marey.generation.shots.flowing import LIFT_M, steps_between
from marey.generation.shots.windows import CROSSFADE
from marey.motion.features import FeatureLayout, HeadingLayout
from marey.motion.feet import runs
from marey.motion.filters import smooth
from marey.motion.kinematics import facing
from marey.motion.legs import two_bone_knee
from marey.motion.skeleton import HUMANML3D
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
STOOD = CROSSFADE + 1
"""Frames in which a body stands before it steps, and behind: there, a network has changed its feet as well."""
PASSES_S = 0.04
"""Standard deviation of the filter of the arc, seconds."""


def between_stances(
    features: Float32, layout: FeatureLayout, cut: Float32, spans: Sequence[tuple[int, int]]
) -> Float32:
    """Return features (T, D) of a body that steps from one stance to the next, where a network would push its feet.

    Args:
        features: of the whole, in the layout's own units.
        layout: of the features; on another skeleton than that of HumanML3D nothing is changed.
        cut: (T, D) the movements that the whole leads from one to the next, cut to each other.
        spans: the first frame of each way between stances, and the one after its last, with the cut at one of them.
            Where a foot moves beside the cut, nothing is changed.
    """
    if not _knows_feet(layout):
        return features
    joints, stood = (layout.decode(each).astype(np.float64) for each in (features, cut))
    stepped, contacts = joints.copy(), layout.contacts(features)
    for begin, end in spans:
        if not _stands(stood, layout.fps, begin, end):
            continue
        share = np.clip(np.arange(1 - STOOD, end - begin + STOOD) / (end - begin + 1), 0.0, 1.0)
        way = slice(begin - STOOD, end + STOOD - 1)
        here, there = (joints[at : at + 1].repeat(len(share), axis=0) for at in (begin - STOOD, end + STOOD - 1))
        steps = steps_between(here, there, share)
        if any(goes.any() for _, goes in steps.values()):
            for number, (side, (places, goes)) in enumerate(sorted(steps.items())):
                stepped[way, list(LEGS[side][2:])] = places
                contacts[way, 2 * number : 2 * number + 2] &= ~goes[:, None]
    if np.array_equal(stepped, joints):
        return features
    changed = _with_legs(features, layout, joints, stepped)
    changed[:, layout.slices["contacts"]] = contacts
    return changed


def _stands(cut: Array, fps: float, begin: int, end: int) -> bool:
    """Return True if a body stands in both of two movements that are cut to each other within some frames."""
    if begin < STOOD or end + STOOD > len(cut):
        return False
    toes = cut[begin - STOOD : end + STOOD, [leg[3] for leg in LEGS.values()]]
    speeds = np.linalg.norm(np.diff(toes * LEVEL, axis=0), axis=-1).max(axis=1) * fps
    at = [STOOD - 1, len(speeds) - STOOD]  # the cut is at one of them
    rests = min(float(np.delete(speeds, each).max()) for each in at)
    return rests < MOVES_M_S and float(np.ptp(toes[..., 1])) < STEPS_M


def with_steps(features: Float32, layout: FeatureLayout, spans: Sequence[tuple[int, int]]) -> Float32:
    """Return features (T, D) whose feet step where they slid.

    Args:
        features: of the whole, in the layout's own units.
        layout: of the features; on another skeleton than that of HumanML3D nothing is changed.
        spans: the first frame of each transition, and the one after its last.
    """
    if not _knows_feet(layout):
        return features
    joints = layout.decode(features).astype(np.float64)
    stepped = joints.copy()
    for begin, end in spans:
        for side, first, last in _slides(joints, layout.fps, begin, end):
            _lift(stepped, side, first, last, layout.fps)
    if np.array_equal(stepped, joints):
        return features
    return _with_legs(features, layout, joints, stepped)


def _knows_feet(layout: FeatureLayout) -> TypeGuard[HeadingLayout]:
    """Return True of a layout whose joints can be moved, on a body whose `LEGS` are known."""
    return isinstance(layout, HeadingLayout) and layout.skeleton.name == HUMANML3D.name


def _with_legs(features: Float32, layout: HeadingLayout, joints: Array, stepped: Array) -> Float32:
    """Return features of joints (T, 22, 3) whose ankles and toes are elsewhere, their knees bent accordingly."""
    moved = stepped - joints
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
