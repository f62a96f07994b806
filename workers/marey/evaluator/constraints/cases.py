"""Cases: prompts with constraints. Shapes are drawn here; paths, poses and hands of captured clips are read from a
prepared folder, since clips are not part of the product."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.evaluations import TEST_SPLIT
from marey.items.constraints import EFFECTOR_TARGET, POSE_KEYFRAME, ROOT_PATH, Constraint, read_constraints
from marey.motion.body import standard_body, travel_scale
from marey.motion.filters import smooth
from marey.motion.kinematics import facing
from marey.motion.pose import solve_pose
from marey.motion.rotations import Array, from_euler
from marey.motion.skeleton import HUMANML3D

FPS = 20.0
STEP = 5
"""Frames between two points of a path."""
SPEEDS = (0.5, 1.0, 1.5, 2.0)
"""Metres a second."""
PROMPTS = {
    0.5: ("a person walks slowly", "someone strolls along slowly", "a man walks forward slowly"),
    1.0: ("a person walks forward", "someone is walking", "a woman walks ahead at an easy pace"),
    1.5: ("a person walks quickly", "someone walks briskly forward", "a man strides forward"),
    2.0: ("a person jogs forward", "someone jogs along", "a person runs forward at an easy pace"),
}
LONGEST_S, FARTHEST = 8.0, 8.0
LEAST_TRAVEL = 0.5
"""Metres of the path of a captured clip."""
RADIUS = 2.0
CROUCH = {
    "L_hip": (-75, 0, 8),
    "R_hip": (-75, 0, -8),
    "L_knee": (95, 0, 0),
    "R_knee": (95, 0, 0),
    "L_ankle": (-25, 0, 0),
    "R_ankle": (-25, 0, 0),
    "spine1": (20, 0, 0),
    "L_shoulder": (0, -30, -60),
    "R_shoulder": (0, 30, 60),
}
"""Euler angles in degrees, XYZ, of a pose that no capture has."""
HAND = (-0.3, 1.25, 0.35)
"""Metres from the path: to the right, over the floor, ahead."""


@dataclass(frozen=True)
class Case:
    """A prompt with constraints.

    Attributes:
        name: of the case, unique.
        group: captured, circle, S or L.
        seed: of the motion.
    """

    name: str
    group: str
    prompt: str
    seed: int
    seconds: float
    constraints: Sequence[Constraint] = field(repr=False)


def shape_cases(each: int = 3) -> Iterator[Case]:
    """Yield cases of circles, S and L: a path with headings, a pose at its end, a hand beside it."""
    for group, draw in (("circle", _circle), ("S", _s), ("L", _l)):
        for speed in SPEEDS:
            for number in range(each):
                prompt = PROMPTS[speed][number % len(PROMPTS[speed])]
                places = _in_time(draw(), speed)
                name = f"{group} {speed:g} m/s {number}"
                seconds = len(places) / FPS
                yield Case(name, group, prompt, 100 + number, seconds, read_constraints(_of_shape(places)))


def captured_cases(data: PreparedData, count: int) -> Iterator[Case]:
    """Yield cases of at most `count` test clips that travel: path and headings of the clip, its last pose, and its
    right hand halfway."""
    clips = data.split(TEST_SPLIT)
    travelling = [clip for clip in clips if clip.measured.path >= LEAST_TRAVEL and 24 <= clip.length <= 190]
    chosen = np.linspace(0, len(travelling) - 1, min(count, len(travelling))).round().astype(int)
    for number in chosen:
        yield _captured(data, travelling[number], int(number))


def _captured(data: PreparedData, clip: Clip, number: int) -> Case:
    skeleton = data.layout.skeleton
    scale = travel_scale(skeleton, standard_body(skeleton).skeleton)
    joints = scale * data.joints(clip)[: clip.length].astype(np.float64)
    pose = solve_pose(joints[-8:], skeleton, fps=FPS)
    at = _every(len(joints))
    middle = len(joints) // 2
    rotations = dict(zip(skeleton.joint_names, pose.rotations[-1].tolist(), strict=True))
    wrist = joints[middle, skeleton.index("R_wrist")]
    constraints = read_constraints(
        [
            _path(joints[:, 0, [0, 2]], _headings(joints), at),
            {
                "type": POSE_KEYFRAME,
                "frame": len(joints) - 1,
                "joint_rotations": rotations,
                "root_height": float(joints[-1, 0, 1]),
            },
            {"type": EFFECTOR_TARGET, "joint": "right_wrist", "frames": [middle], "positions": [wrist.tolist()]},
        ]
    )
    return Case(clip.id, "captured", clip.captions[0], number, clip.length / FPS, constraints)


def _headings(joints: Array) -> Array:
    ahead = smooth(facing(joints, HUMANML3D), 0.25 * FPS)
    return np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2]))


def _of_shape(places: Array) -> list[Constraint]:
    step = smooth(np.gradient(places, axis=0), 0.2 * FPS)
    headings = np.unwrap(np.arctan2(step[:, 0], step[:, 1]))
    middle = 3 * len(places) // 5
    aside, height, ahead = HAND
    turn = headings[middle]
    x = places[middle, 0] + np.cos(turn) * aside + np.sin(turn) * ahead
    z = places[middle, 1] - np.sin(turn) * aside + np.cos(turn) * ahead
    identity = {name: [1.0, 0.0, 0.0, 0.0] for name in HUMANML3D.joint_names}
    crouch = {name: from_euler(np.array(angles, float), "XYZ").tolist() for name, angles in CROUCH.items()}
    return [
        _path(places, headings, _every(len(places))),
        {"type": POSE_KEYFRAME, "frame": len(places) - 1, "joint_rotations": {**identity, **crouch}},
        {
            "type": EFFECTOR_TARGET,
            "joint": "right_wrist",
            "frames": [middle],
            "positions": [[float(x), height, float(z)]],
        },
    ]


def _path(places: Array, headings: Array, at: list[int]) -> Constraint:
    return {
        "type": ROOT_PATH,
        "frames": at,
        "positions_xz": places[at].tolist(),
        "heading_radians": headings[at].tolist(),
    }


def _every(frames: int) -> list[int]:
    return sorted({*range(0, frames, STEP), frames - 1})


def _in_time(line: Array, speed: float) -> Array:
    """Return the places (T, 2) of a walk along a line (n, 2) that slows down at its end, as a body does."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    frames = int(min(LONGEST_S, min(along[-1], FARTHEST) / speed + 0.5) * FPS)
    slowing = np.minimum(1.0, (frames - 1 - np.arange(frames)) / (1.0 * FPS))
    way = np.concatenate([[0.0], np.cumsum(slowing[:-1])]) * speed / FPS
    return np.stack([np.interp(way, along, line[:, k]) for k in range(2)], axis=1)


def _circle() -> Array:
    angle = np.linspace(0, 2 * np.pi, 400)
    return RADIUS * np.stack([1 - np.cos(angle), np.sin(angle)], axis=1)


def _s() -> Array:
    u = np.linspace(0, 1, 400)
    return np.stack([1.0 - np.cos(2 * np.pi * u), 6.0 * u], axis=1)


def _l() -> Array:
    return np.array([[0.0, 0.0], [0.0, 3.0], [5.0, 3.0]])
