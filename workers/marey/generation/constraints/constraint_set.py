"""Constraints of one clip as arrays: in its own frames, on its own skeleton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.items.constraint_frames import frames_of
from marey.items.constraints import EFFECTOR_TARGET, POSE_KEYFRAME, ROOT_PATH
from marey.motion.hands import arms
from marey.motion.keyframes import ordered_rotations
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import Array, normalize
from marey.motion.skeleton import Skeleton
from marey.motion.stance import standing_height
from marey.quality.constraints import EFFECTOR_M, POSE_M


@dataclass(frozen=True, eq=False)
class Path:
    """Places of the root.

    Attributes:
        number: of the constraint.
        frames: (n,) rising, whole or between two.
        places: (n, 2) X and Z, metres.
        headings: (n,) radians from +Z, or None.
    """

    number: int
    frames: Array = field(repr=False)
    places: Array = field(repr=False)
    headings: Array | None = field(repr=False)


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A pose at a frame.

    Attributes:
        number: of the constraint.
        frame: of the clip.
        rotations: (J, 4) local quaternions.
        root: (3,) metres, or None: the pose takes the place and heading that the clip has there.
        height: of the root without a place, metres; None = the pose stands on the floor.
    """

    number: int
    frame: int
    rotations: Array = field(repr=False)
    root: Array | None = field(repr=False)
    height: float | None


@dataclass(frozen=True, eq=False)
class Target:
    """Places of a joint at frames.

    Attributes:
        number: of the constraint.
        name: of the effector.
        joint: its index.
        frames: (n,) whole numbers.
        places: (n, 3) metres.
        rotations: (n, 4) world quaternions, or None.
    """

    number: int
    name: str
    joint: int
    frames: tuple[int, ...] = field(repr=False)
    places: Array = field(repr=False)
    rotations: Array | None = field(repr=False)


@dataclass(frozen=True, eq=False)
class ConstraintSet:
    """All constraints of one clip.

    Attributes:
        fps: of the clip.
        frames: its length.
        retimed: its speed may be changed, and parts left out or repeated.
    """

    fps: float
    frames: int
    paths: tuple[Path, ...]
    keyframes: tuple[Keyframe, ...]
    targets: tuple[Target, ...]
    retimed: bool = True

    def at_rate(self, fps: float, frames: int) -> ConstraintSet:
        """Return the paths at another rate, without other constraints."""
        paths = tuple(replace(path, frames=path.frames * (fps / self.fps)) for path in self.paths)
        return ConstraintSet(fps, frames, paths, (), (), self.retimed)


def asked_of(constraints: Sequence[Mapping[str, Any]], skeleton: Skeleton, frames: int, fps: float) -> ConstraintSet:
    """Return checked constraints as arrays.

    Raises:
        InvalidInput: a pose of another skeleton, one that still names a motion, or one in which a joint is not where a
            target at the same frame wants it; with the field in `where`.
    """
    numbered = list(enumerate(constraints))
    asked = ConstraintSet(
        fps,
        frames,
        tuple(_path(number, each, fps) for number, each in numbered if each["type"] == ROOT_PATH),
        tuple(_keyframe(number, each, skeleton) for number, each in numbered if each["type"] == POSE_KEYFRAME),
        tuple(_target(number, each, skeleton) for number, each in numbered if each["type"] == EFFECTOR_TARGET),
    )
    for key in asked.keyframes:
        _check_pose(key, asked.targets, skeleton)
    return asked


def _check_pose(key: Keyframe, targets: Sequence[Target], skeleton: Skeleton) -> None:
    """Check that joints of a pose are at the targets that its frame has; of a pose without a place, their heights.

    Raises:
        InvalidInput: one is farther away than both bars together.
    """
    at_once = [(target, target.frames.index(key.frame)) for target in targets if key.frame in target.frames]
    if not at_once:
        return
    height = standing_height(key.rotations, skeleton) if key.height is None else key.height
    root = np.array([0.0, height, 0.0]) if key.root is None else key.root
    joints = forward_kinematics(skeleton, key.rotations[None], root[None])[0]
    for target, point in at_once:
        way = target.places[point] - joints[target.joint]
        far = float(np.linalg.norm(way) if key.root is not None else abs(way[1]))
        if far > POSE_M + EFFECTOR_M:
            raise InvalidInput(
                f"is {100 * far:.0f} cm from the place that the pose of constraints.{key.number} gives to it, at the "
                f"same frame {key.frame}; at most {100 * (POSE_M + EFFECTOR_M):.0f}",
                where=f"constraints.{target.number}.positions.{point}",
                hint="Leave one of the two out, or give them frames of their own.",
            )


def effector(skeleton: Skeleton, name: str) -> int:
    """Return the joint of an effector by its role: wrists end the arms, feet are known, the head is named so."""
    (*_, right), (*_, left) = arms(skeleton)
    roles = dict(zip(("left_ankle", "left_foot", "right_ankle", "right_foot"), skeleton.feet, strict=True))
    roles |= {"left_wrist": left, "right_wrist": right, "pelvis": 0}
    if name in roles:
        return roles[name]
    found = [j for j, joint in enumerate(skeleton.joint_names) if name in joint.lower()]
    if not found:
        raise InvalidInput(f"the skeleton {skeleton.name} has no {name}", where="constraints")
    return found[0]


def _path(number: int, each: Mapping[str, Any], fps: float) -> Path:
    headings = each.get("heading_radians")
    return Path(
        number,
        np.array(frames_of(each, fps), np.float64),
        np.array(each["positions_xz"], np.float64),
        None if headings is None else np.unwrap(np.array(headings, np.float64)),
    )


def _keyframe(number: int, each: Mapping[str, Any], skeleton: Skeleton) -> Keyframe:
    where = f"constraints.{number}.joint_rotations"
    if "joint_rotations" not in each:
        raise InvalidInput("the motion was not read", where=f"constraints.{number}.motion")
    given = ordered_rotations(each["joint_rotations"], skeleton, where)
    root = each.get("root_position")
    place = None if root is None else np.array(root, np.float64)
    return Keyframe(number, each["frame"], normalize(np.array(given, np.float64)), place, each.get("root_height"))


def _target(number: int, each: Mapping[str, Any], skeleton: Skeleton) -> Target:
    turns = each.get("rotations")
    return Target(
        number,
        each["joint"],
        effector(skeleton, each["joint"]),
        tuple(each["frames"]),
        np.array(each["positions"], np.float64),
        None if turns is None else normalize(np.array(turns, np.float64)),
    )
