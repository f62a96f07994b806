"""Targets of hands, feet, head and pelvis: the trunk leans and the root gives way as far as a limb does not reach, then
limbs bend by closed-form inverse kinematics; all changes fade in and out."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.generation.constraints.constraint_set import Target
from marey.generation.constraints.poses import BodyMotion
from marey.motion.curves import fades
from marey.motion.hands import arms
from marey.motion.kinematics import facing, forward_kinematics, global_rotations
from marey.motion.legs import follow_feet, foot_chain, two_bone_knee
from marey.motion.pose import aim_bones
from marey.motion.rotations import (
    Array,
    between,
    conjugate,
    from_rotvec,
    length,
    multiply,
    normalize,
    to_rotvec,
)
from marey.motion.skeleton import Skeleton

FADE_S = 0.4
LONGEST_S, PER_METRE_S = 0.8, 0.7
REACH = 0.985
"""Share of an arm's length that it is stretched."""
ROUNDS = 24
MOST_LEAN = 1.0
"""Radians that the trunk leans for a target."""
MOST_ASIDE, MOST_DOWN, MOST_UP = 0.12, 0.45, 0.03
"""Metres that the root gives way."""


def trunk(skeleton: Skeleton) -> list[int]:
    """Return the joints between the root and the one that the arms hang from, the lowest first."""
    shoulder = skeleton.facing[2]
    above: list[int] = []
    joint = skeleton.parents[shoulder]
    while joint > 0:
        above.insert(0, joint)
        joint = skeleton.parents[joint]
    return [j for j in above if j not in (skeleton.parents[shoulder],)] or above


def with_targets(posed: BodyMotion, targets: Sequence[Target], skeleton: Skeleton, fps: float) -> BodyMotion:
    """Return the motion with its effectors at their targets."""
    if not targets:
        return posed
    wanted = _by_frame(targets)
    posed = _body(posed, wanted, skeleton, fps)
    joints = posed.joints(skeleton)
    before = joints.copy()
    legs_moved = False
    for name, (at, places, joint) in _by_joint(targets).items():
        need = places - joints[at, joint]
        spans = _spans(need, fps)
        move = fades(at, need, spans, len(joints))
        if "wrist" in name:
            _move_hand(joints, joint, move, skeleton)
        elif name.endswith(("ankle", "foot")):
            side = 0 if name.startswith("left") else 1
            joints[:, foot_chain(skeleton, skeleton.feet[2 * side + 1])] += move[:, None]
            legs_moved = True
    contacts = posed.contacts.copy()
    if legs_moved:
        follow_feet(before, joints, np.zeros((len(joints), 2), bool), skeleton, fps)
    rotations = aim_bones(joints, posed.rotations, skeleton)
    rotations = _turn_ends(rotations, targets, skeleton, fps)
    return BodyMotion(rotations, joints[:, 0], contacts)


def _by_frame(targets: Sequence[Target]) -> Mapping[int, list[tuple[str, int, Array]]]:
    found = defaultdict[int, list[tuple[str, int, Array]]](list)
    for target in targets:
        for frame, place in zip(target.frames, target.places, strict=True):
            found[frame].append((target.name, target.joint, place))
    return found


def _by_joint(targets: Sequence[Target]) -> Mapping[str, tuple[NDArray[np.intp], Array, int]]:
    """Return frames (n,), places (n, 3) and joint of each effector, in the order of frames."""
    found: dict[str, tuple[NDArray[np.intp], Array, int]] = {}
    for name in dict.fromkeys(target.name for target in targets):
        its = [target for target in targets if target.name == name]
        rows = {f: p for target in its for f, p in zip(target.frames, target.places, strict=True)}
        frames = sorted(rows)
        found[name] = np.array(frames, np.intp), np.stack([rows[f] for f in frames]), its[0].joint
    return found


def _spans(need: Array, fps: float) -> Array:
    return np.clip(PER_METRE_S * np.linalg.norm(need, axis=1), FADE_S, LONGEST_S) * fps


def _body(
    posed: BodyMotion, wanted: Mapping[int, list[tuple[str, int, Array]]], skeleton: Skeleton, fps: float
) -> BodyMotion:
    """Return the motion with a trunk that leans, and a root that gives way, as far as limbs do not reach."""
    frames = sorted(wanted)
    solved = [_lean(posed.rotations[f], posed.root[f], wanted[f], skeleton) for f in frames]
    leans, moves = np.stack([lean for lean, _ in solved]), np.stack([move for _, move in solved])
    if not leans.any() and not moves.any():
        return posed
    at, size = np.array(frames), np.concatenate([0.5 * leans, moves], axis=1)
    changes = fades(at, np.concatenate([leans, moves], axis=1), _spans(size, fps), len(posed.root))
    before = posed.joints(skeleton)
    rotations = _leaning(posed.rotations, changes[:, :3], skeleton)
    moved = forward_kinematics(skeleton, rotations, posed.root + changes[:, 3:])
    start = moved.copy()
    for toe in skeleton.feet[1::2]:
        chain = foot_chain(skeleton, toe)
        moved[:, chain] = before[:, chain]
    follow_feet(start, moved, posed.contacts[:, 1::2], skeleton, fps)
    return BodyMotion(aim_bones(moved, rotations, skeleton), moved[:, 0], posed.contacts)


def _leaning(rotations: Array, lean: Array, skeleton: Skeleton) -> Array:
    """Return rotations (T, J, 4) of a trunk that leans as a whole by rotation vectors (T, 3) in the world."""
    joints = trunk(skeleton)
    world = global_rotations(skeleton, rotations)
    turned = rotations.copy()
    share = from_rotvec(lean / len(joints))
    for joint in joints:
        above = world[:, skeleton.parents[joint]]
        turned[:, joint] = multiply(multiply(conjugate(above), multiply(share, above)), turned[:, joint])
    return turned


def _lean(
    rotations: Array, root: Array, wanted: Sequence[tuple[str, int, Array]], skeleton: Skeleton
) -> tuple[Array, Array]:
    """Return the lean of the trunk (3,) and the move of the root (3,) with which limbs reach their targets."""
    lean, move = np.zeros(3), np.zeros(3)
    pelvis = [place for name, _, place in wanted if name == "pelvis"]
    if pelvis:
        move = pelvis[0] - root
    for _ in range(ROUNDS):
        turned = _leaning(rotations[None], lean[None], skeleton)
        joints = forward_kinematics(skeleton, turned, (root + move)[None])[0]
        missing = [_missing(joints, name, joint, place, skeleton) for name, joint, place in wanted]
        missing = [(grip, way) for grip, way in missing if np.linalg.norm(way) > 1e-3]
        if not missing:
            break
        pivot = joints[trunk(skeleton)[0]]
        ways = [to_rotvec(between(grip - pivot, grip + way - pivot)) for grip, way in missing]
        lean = lean + np.mean(ways, axis=0)
        lean *= min(1.0, MOST_LEAN / max(float(np.linalg.norm(lean)), 1e-9))
        if not pelvis:
            move = _limited(move + 0.3 * np.mean([way for _, way in missing], axis=0))
    return lean, move


def _limited(move: Array) -> Array:
    aside = np.array([move[0], 0.0, move[2]])
    aside *= min(1.0, MOST_ASIDE / max(float(np.linalg.norm(aside)), 1e-9))
    aside[1] = np.clip(move[1], -MOST_DOWN, MOST_UP)
    return aside


def _missing(joints: Array, name: str, joint: int, place: Array, skeleton: Skeleton) -> tuple[Array, Array]:
    """Return the joint of the trunk (3,) that has to move, and the way (3,) that it has to, zero for one in reach."""
    if name == "head":
        return joints[joint], place - joints[joint]
    if "wrist" not in name:
        return joints[joint], np.zeros(3)
    shoulder, elbow, wrist = next(arm for arm in arms(skeleton) if arm[2] == joint)
    reach = REACH * float(length(joints[elbow] - joints[shoulder]) + length(joints[wrist] - joints[elbow]))
    way = place - joints[shoulder]
    over = max(float(np.linalg.norm(way)) - reach, 0.0)
    return joints[shoulder], over * normalize(way)


def _move_hand(joints: Array, wrist: int, move: Array, skeleton: Skeleton) -> None:
    """Move one wrist (T, 3), in place; the elbow follows."""
    shoulder, elbow, _ = next(arm for arm in arms(skeleton) if arm[2] == wrist)
    moves = np.abs(move).max(axis=1) > 0
    arm = joints[:, [shoulder, elbow, wrist]]
    target = arm[:, 2] + move
    bent = two_bone_knee(arm, arm[:, 0], target, -facing(joints, skeleton))
    forearm = length(arm[:, 2] - arm[:, 1])[:, None]
    hand = bent + forearm * normalize(target - bent)
    joints[moves, elbow], joints[moves, wrist] = bent[moves], hand[moves]


def _turn_ends(rotations: Array, targets: Sequence[Target], skeleton: Skeleton, fps: float) -> Array:
    """Return rotations (T, J, 4) with effectors turned as asked in the world."""
    turned = rotations.copy()
    for target in targets:
        if target.rotations is None:
            continue
        at = np.array(target.frames)
        world = global_rotations(skeleton, turned)
        turn = to_rotvec(multiply(target.rotations, conjugate(world[at, target.joint])))
        change = from_rotvec(fades(at, turn, np.full(len(at), FADE_S * fps), len(turned)))
        above = skeleton.parents[target.joint]
        own = multiply(change, world[:, target.joint])
        turned[:, target.joint] = multiply(conjugate(world[:, above]), own) if above >= 0 else own
    return turned
