"""Read the rig of a BVH file.

All rotations zero need not be a rest pose: iClone writes bones that all point along one axis. The rest pose is the
first frame where that frame stands apart from the motion, as a T-pose does, or where it stands and the zero pose does
not. A pose that is only taken because no other is better is noted as a guess. The format has no unit: the one that
makes the body nearest to a person is taken, and noted.
"""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.io.bvh import BvhClip, first_frame_stands_apart, parse_bvh
from marey.motion.kinematics import global_rotations
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.make_rig import RigNode, make_rig
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import IDENTITY, Array, to_matrix
from marey.motion.units import METRES

FRAMES = 240
"""Frames at the begin of a file that tell its rest pose; a take of 64 MiB would need 700 MiB."""
UNITS = ("cm", "m", "in", "mm", "ft")
"""Units in which BVH files are found, the usual one first."""
FIGURE, PERSON = (0.25, 2.5), (0.55, 1.15)
"""Metres of legs: of any figure, for which the usual unit is kept, and of a person, from which another unit is told."""

FROM_FRAME, FROM_ZERO = "the rest pose is the first frame", "the rest pose is the one without rotations"
BETTER = "a file that begins with a T-pose gives better motions"


def parse_bvh_rig(data: bytes, where: str = "bvh") -> Rig:
    """Read the rig of a BVH file.

    Raises:
        InvalidFile: broken up to the last of its first `FRAMES` frames; the rest is not read.
        TooLarge: over the limits of BVH files or of rigs.
    """
    clip = parse_bvh(data, where, unit="m", rest_frame="keep", frames=FRAMES)
    sha256 = hashlib.sha256(data).hexdigest()
    zero = _rig(clip, np.tile(IDENTITY, (len(clip.skeleton), 1)), where, sha256)
    first = _rig(clip, global_rotations(clip.skeleton, clip.rotations[:1])[0], where, sha256)
    if first_frame_stands_apart(clip):
        return _with_unit(replace(first, notes=(*clip.notes, FROM_FRAME)))
    if _stands(zero):
        return _with_unit(replace(zero, notes=clip.notes))
    chosen, found = (first, FROM_FRAME) if _stands(first) else (zero, FROM_ZERO)
    return _with_unit(replace(chosen, notes=(*clip.notes, f"{found}, which need not be one: {BETTER}")))


def _rig(clip: BvhClip, world: Array, where: str, sha256: str) -> Rig:
    """Return the rig whose rest pose has these orientations (J, 4) of the joints, in metres and Y up."""
    tree = clip.skeleton
    axes = to_matrix(world)
    nodes: list[RigNode] = []
    for joint, (name, parent) in enumerate(zip(tree.joint_names, tree.parents, strict=True)):
        matrix: NDArray[np.float64] = np.eye(4)
        matrix[:3, :3] = axes[joint]
        if parent >= 0:
            matrix[:3, 3] = nodes[parent].matrix[:3, :3] @ tree.offsets[joint] + nodes[parent].matrix[:3, 3]
        end = clip.ends[joint]
        tip = None if np.isnan(end).any() else (float(end[0]), float(end[1]), float(end[2]))
        nodes.append(RigNode(name, parent, matrix, tip=tip))
    name = PurePath(where).name
    return make_rig(nodes, name=name, where=where, unit=1.0, up="y", source="bvh", sha256=sha256)


def _stands(rig: Rig) -> bool:
    try:
        return RigBody.of(rig, sized=False).standing
    except InvalidInput:  # no legs are found: that is said when the rig is used
        return False


def _with_unit(rig: Rig) -> Rig:
    """Return the rig with its lengths in the unit that makes its legs those of a person; centimetres if none does."""
    try:
        leg = RigBody.of(rig, sized=False).leg
    except InvalidInput:
        leg = 0.0
    usual = FIGURE[0] <= leg * METRES[UNITS[0]] <= FIGURE[1]
    fits = [unit for unit in UNITS if usual or PERSON[0] <= leg * METRES[unit] <= PERSON[1]]
    name = fits[0] if fits else UNITS[0]
    metres = METRES[name]
    return replace(
        rig,
        positions=rig.positions * metres,
        tips=rig.tips * metres,
        scales=rig.scales * metres,
        unit=metres,
        notes=(*rig.notes, f"lengths are read as {name}"),
    )
