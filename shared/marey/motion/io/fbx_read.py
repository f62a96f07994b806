"""Read motions of binary FBX files, of Marey and of other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marey.core.errors import TooLarge
from marey.motion.files import read_limited
from marey.motion.io.bvh import BvhClip
from marey.motion.io.fbx_curves import Animation, read_animation
from marey.motion.io.fbx_scene import Scene, read_scene
from marey.motion.io.fbx_skeleton import bones_of, skeleton_order
from marey.motion.io.fbx_transforms import World, world_transforms
from marey.motion.rotations import Array, conjugate, from_matrix, multiply, rotate, unroll
from marey.motion.skeleton import Skeleton, distinct_names, mirror_by_name

MAX_BYTES = 256 * 2**20
MAX_POSES = 1_000_000
"""Frames times joints: four minutes of 65 joints at 60 frames a second."""
STILL = 1e-5  # metres that a joint may move from its parent and still have a constant offset


def read_fbx(path: Path | str) -> BvhClip:
    """Read the motion of a binary FBX file, as a BVH file would hold it; see `parse_fbx`.

    Raises:
        NotFound: no such file.
        InvalidFile: ASCII, broken, without a skeleton or without a motion of it.
        TooLarge: over 256 MiB, 2,000 joints or a million poses of a joint.
    """
    path = Path(path)
    return parse_fbx(read_limited(path, MAX_BYTES), str(path))


def parse_fbx(data: bytes, where: str = "fbx") -> BvhClip:
    """Read the bytes of an FBX file.

    The offsets are the bind pose, or the pose of the nodes where the file has none, and rotations are from it, so that
    no joint is turned at rest: the directions of joint axes are lost. Frames are those of the file's rate from the
    first to the last key. Of several skeletons the largest is read.
    """
    scene = read_scene(data, where)
    bones = bones_of(scene)
    order = skeleton_order(scene, bones)
    order, notes = _largest(scene, order, bones)
    animation = read_animation(scene, set(order))
    times = _times(animation, scene.fps, len(order), where)
    joints = [key for key in order if key in bones]
    names = distinct_names(scene.models[key].name or "joint" for key in joints)
    rest = world_transforms(scene, order, {}, bind=True)
    moving = world_transforms(scene, order, animation.sample(scene, times))
    parents = _parents(scene, joints)
    return _clip(scene, joints, names, parents, rest, moving, len(times), (*notes, *animation.notes))


def _times(animation: Animation, fps: float, joints: int, where: str) -> Array:
    """Return the times of the frames.

    Raises:
        TooLarge: more of them than fit.
    """
    frames = (animation.stop - animation.start) * fps + 1.001
    if frames * joints > MAX_POSES:
        message = f"{frames:.0f} frames of {joints} joints, over the limit of {MAX_POSES:,} poses of a joint"
        raise TooLarge(message, where=where, hint="Export a shorter range, or fewer frames a second.")
    return animation.start + np.arange(int(frames)) / fps


def _largest(scene: Scene, order: list[int], bones: set[int]) -> tuple[list[int], tuple[str, ...]]:
    """Return the nodes of the largest skeleton: one topmost bone and all below and above it."""
    top: dict[int, int] = {}
    for key in order:
        parent = scene.parents.get(key, 0)
        if parent in top:
            top[key] = top[parent]
        elif key in bones:
            top[key] = key
    roots = list(top.values())
    root = max(dict.fromkeys(roots), key=roots.count)
    kept = {key for key, of in top.items() if of == root}
    at: int | None = root
    while at is not None:
        kept.add(at)
        at = scene.parents.get(at)
    count = len(set(roots))
    name = scene.models[root].name
    notes = (f"{count} skeletons in the file; that of {name!r} is read",) if count > 1 else ()
    return [key for key in order if key in kept], notes


def _parents(scene: Scene, joints: list[int]) -> tuple[int, ...]:
    """Return the nearest joint above each joint."""
    place = {key: joint for joint, key in enumerate(joints)}
    parents: list[int] = []
    for key in joints:
        above = scene.parents.get(key)
        while above is not None and above not in place:
            above = scene.parents.get(above)
        parents.append(-1 if above is None else place[above])
    return tuple(parents)


def _clip(
    scene: Scene,
    joints: list[int],
    names: tuple[str, ...],
    parents: tuple[int, ...],
    rest: World,
    moving: World,
    frames: int,
    notes: tuple[str, ...],
) -> BvhClip:
    axes, unit = scene.axes(), scene.unit
    start = np.stack([rest.places[key] for key in joints]) @ axes.T * unit
    at_rest = from_matrix(axes @ _turns(np.stack([rest.linear[key] for key in joints])))
    spread = [np.broadcast_to(moving.places[key], (frames, 3)) for key in joints]
    places = np.stack(spread, axis=1) @ axes.T * unit
    turned = [np.broadcast_to(moving.linear[key], (frames, 3, 3)) for key in joints]
    world = multiply(from_matrix(axes @ _turns(np.stack(turned, axis=1))), conjugate(at_rest))
    above = list(parents[1:])
    rotations = world.copy()
    rotations[:, 1:] = multiply(conjugate(world[:, above]), world[:, 1:])
    offsets, local = start.copy(), places.copy()
    offsets[0] = 0.0
    offsets[1:] = start[1:] - start[above]
    local[:, 1:] = rotate(conjugate(world[:, above]), places[:, 1:] - places[:, above])
    if not (np.isfinite(local).all() and np.isfinite(rotations).all() and np.abs(offsets).max() < 1e6):
        raise scene.file.broken("holds numbers that are not finite, or far from it")
    still = np.abs(local[:, 1:] - offsets[1:]).max(initial=0.0) < STILL
    return BvhClip(
        skeleton=Skeleton("other", names, parents, offsets.astype(np.float32), mirror_by_name(names)),
        rotations=unroll(rotations),
        root=places[:, 0].copy(),
        positions=None if still else local,
        fps=scene.fps,
        ends=np.full((len(joints), 3), np.nan),
        notes=notes,
    )


def _turns(linear: Array) -> Array:
    """Return the rotations of matrices, without their scale."""
    return linear / np.maximum(np.linalg.norm(linear, axis=-2, keepdims=True), 1e-12)
