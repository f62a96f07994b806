"""BVH clips at another rate, with bones of constant length, and as `MotionClip`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marey.motion.clip import MotionClip
from marey.motion.feet import find_contacts
from marey.motion.io.bvh import BvhClip
from marey.motion.kinematics import facing, forward_kinematics, global_rotations
from marey.motion.resample import frame_times, interpolate, interpolate_rotations
from marey.motion.rigs.landmarks import feet_and_facing
from marey.motion.rotations import Array, about, multiply, rotate
from marey.motion.skeleton import known_order, skeleton_of


def resample_bvh(clip: BvhClip, fps: float) -> BvhClip:
    """Resample a BVH clip; see `resample`."""
    times = frame_times(len(clip.root), clip.fps, fps)
    return replace(
        clip,
        rotations=interpolate_rotations(clip.rotations, times),
        root=interpolate(clip.root, times),
        positions=None if clip.positions is None else interpolate(clip.positions, times),
        fps=fps,
    )


def steady(clip: BvhClip) -> BvhClip:
    """Return the motion with bones of constant length.

    A root that only carries another joint (Bandai-Namco's `joint_Root` over the travelling `Hips`) is merged into it.
    Where a root stands still over hips that travel, as in Unreal's rigs, the body from the hips down is kept.
    Joints that move relative to their parents get their mean offset, and a note gives the largest error.
    """
    positions = clip.positions
    if positions is None:
        return clip
    while len(clip.skeleton.children[0]) == 1 and len(clip.skeleton) > 2 and np.ptp(positions[:, 1], axis=0).any():
        clip, positions = _without_root(clip, positions)
    clip, positions = _from_travelling(clip, positions)
    skeleton = clip.skeleton.with_offsets(np.concatenate([np.zeros((1, 3)), positions.mean(axis=0)[1:]]))
    fixed = replace(clip, skeleton=skeleton, positions=None)
    off = float(np.linalg.norm(fixed.joints() - clip.joints(), axis=-1).max())
    if off > 1e-3:
        note = f"bones change their length; with constant ones a joint is {1e3 * off:.0f} mm off at most"
        fixed = replace(fixed, notes=(*clip.notes, note))
    return fixed


def _without_root(clip: BvhClip, positions: Array) -> tuple[BvhClip, Array]:
    """Make joint 1 the root, with the old root's rotation and position merged into it."""
    tree = clip.skeleton
    root = clip.root + rotate(clip.rotations[:, 0], positions[:, 1])
    rotations = clip.rotations[:, 1:].copy()
    rotations[:, 0] = multiply(clip.rotations[:, 0], clip.rotations[:, 1])
    positions = positions[:, 1:].copy()
    positions[:, 0] = root
    skeleton = skeleton_of(tree.joint_names[1:], tuple(p - 1 for p in tree.parents[1:]), tree.offsets[1:])
    ends = clip.ends[1:]
    merged = replace(clip, skeleton=skeleton, rotations=rotations, root=root, positions=positions, ends=ends, rest=None)
    return merged, positions


def _from_travelling(clip: BvhClip, positions: Array) -> tuple[BvhClip, Array]:
    """Make the joint that travels the root, if the root stands still and most joints hang on that one."""
    tree, count = clip.skeleton, len(clip.skeleton)
    moves = np.ptp(positions, axis=0).max(axis=-1) > 1e-3
    if moves[0] or not moves.any():
        return clip, positions
    for hips in np.flatnonzero(moves).tolist():
        kept = [hips]
        for joint in range(hips + 1, count):
            if tree.parents[joint] in kept:
                kept.append(joint)
        if 2 * len(kept) > count:
            break
    else:
        return clip, positions
    world, joints = global_rotations(tree, clip.rotations), clip.joints()
    rotations, positions = clip.rotations[:, kept].copy(), positions[:, kept].copy()
    rotations[:, 0], positions[:, 0] = world[:, hips], joints[:, hips]
    skeleton = skeleton_of(
        tuple(tree.joint_names[joint] for joint in kept),
        (-1, *(kept.index(tree.parents[joint]) for joint in kept[1:])),
        tree.offsets[kept],
    )
    notes = (*clip.notes, f"{count - len(kept)} joints beside the body are left out")
    moved = replace(
        clip, skeleton=skeleton, rotations=rotations, root=joints[:, hips], positions=positions,
        ends=clip.ends[kept], rest=None, notes=notes,
    )  # fmt: skip
    return moved, positions


def clip_from_bvh(clip: BvhClip, origin: str) -> MotionClip:
    """Convert a BVH clip: facing +Z in frame 0, with contacts if hips, shoulders and feet are known by name.

    Args:
        clip: with constant bone lengths (see `steady`).
        origin: name of the file, for the manifest.
    """
    clip = steady(clip)
    tree, rotations, root = clip.skeleton, clip.rotations, clip.root
    contacts = np.zeros((len(root), 4), bool)
    manifest = {"origin": origin, "notes": list(clip.notes)}
    known = known_order(tree.joint_names, tree.parents)
    if known is not None:
        ours, order = known
        tree, rotations = ours.with_offsets(tree.offsets[list(order)]), rotations[:, list(order)]
    else:
        feet, looks = feet_and_facing(tree)
        tree = replace(tree, name="other", feet=feet, facing=looks)
    joints = forward_kinematics(tree, rotations, root)
    if tree.facing:
        forward = facing(joints[0], tree)
        turn = about("Y", -np.arctan2(forward[0], forward[2]))
        rotations = np.concatenate([multiply(turn, rotations[:, :1]), rotations[:, 1:]], axis=1)
        root = rotate(turn, root)
    if tree.feet:
        contacts = find_contacts(joints, tree, clip.fps)
    return MotionClip.of(tree, rotations, root, contacts, clip.fps, manifest=manifest)


def as_motion_clip(clip: MotionClip | BvhClip) -> MotionClip:
    """Return a clip as `MotionClip`, converted if it is a BVH clip."""
    return clip_from_bvh(clip, "bvh") if isinstance(clip, BvhClip) else clip
