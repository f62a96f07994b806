"""Write a motion on a rig as BVH.

A BVH file has no joint axes: all rotations zero is the rest pose, with OFFSETs along the axes of the world. A rig that
was read from a BVH file keeps the OFFSETs of that file, whatever pose they are.
"""

from __future__ import annotations

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.io.bvh_write import Layout
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import IDENTITY, Z_TO_Y, Array, continuous_euler, multiply, rotate
from marey.motion.skeleton import Skeleton, mirror_by_name
from marey.motion.units import Unit, Up


def format_rigged_bvh(motion: RiggedMotion, *, unit: Unit = "cm", up: Up = "y", options: ExportOptions = PLAIN) -> str:
    """Return the text of the BVH file.

    Joints that do not hang on the root of the body are left out, for the format has one root.

    Args:
        unit, up: of the file's numbers.
        options: `bvh_root` is heeded; the others are in the motion.

    Raises:
        InvalidInput: numbers that are not finite.
    """
    rig = motion.rig
    kept = _tree(rig, motion.hips)
    place = {joint: number for number, joint in enumerate(kept)}
    axes = _axes(rig)
    parents = [rig.parents[joint] for joint in kept]
    over = [max(parent, 0) for parent in parents]
    inner = np.array([parent >= 0 for parent in parents])[:, None]
    above = np.where(inner, axes[over], IDENTITY)
    rotations = multiply(multiply(above, motion.rotations[:, kept]), axes[kept] * np.array([1.0, -1.0, -1.0, -1.0]))
    translations = rotate(above, motion.translations[:, kept])
    offsets = rotate(above, rig.offsets[kept])
    moving = [number for number, joint in enumerate(kept) if motion.moving[joint] or rig.parents[joint] < 0]
    names = tuple(rig.joint_names[joint] for joint in kept)
    skeleton = Skeleton(
        rig.name,
        names,
        tuple(place.get(parent, -1) for parent in parents),
        offsets.astype(np.float32),
        mirror_by_name(names),
    )
    ends = rotate(axes[kept], rig.tips[kept])
    layout = Layout(
        skeleton, ends=_short(ends, skeleton), unit=unit, up=up, moving=moving, root_offset=options.bvh_root == "offset"
    )
    if not np.isfinite(rotations).all():
        raise InvalidInput("the motion holds NaN or infinite numbers", where=rig.name)
    rows = layout.rows(translations[:, moving], continuous_euler(layout.angles(rotations)))
    return "\n".join([layout.header(str(len(rows)), motion.fps), *rows]) + "\n"


def _axes(rig: Rig) -> Array:
    """Return the orientations (J, 4) of the joints that all rotations zero stand for: of the rest pose, or of the zero
    pose of the BVH file that the rig was read from."""
    if rig.source != "bvh":
        return rig.orientations
    return np.tile(Z_TO_Y if rig.up == "z" else IDENTITY, (len(rig), 1))


def _tree(rig: Rig, hips: int) -> list[int]:
    """Return the joints of the tree that the hips are in."""
    root = hips
    while rig.parents[root] >= 0:
        root = rig.parents[root]
    kept = [root]
    for joint, parent in enumerate(rig.parents):
        if parent in kept:
            kept.append(joint)
    return kept


def _short(ends: Array, skeleton: Skeleton) -> Array:
    """Return End Sites (J, 3) in metres; where the rig states none, a short bone in the direction of the last one."""
    lengths = np.linalg.norm(skeleton.offsets, axis=-1, keepdims=True)
    short = 0.05 * skeleton.offsets / np.maximum(lengths, 1e-9)
    return np.where(np.isfinite(ends), ends, short)
