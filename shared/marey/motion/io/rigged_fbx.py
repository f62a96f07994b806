"""Write motions on a rig as FBX: the rig's hierarchy, names, joint axes and rest pose."""

from __future__ import annotations

import numpy as np

from marey.motion.io.fbx_document import Document
from marey.motion.io.fbx_write import FbxPoses, add_motion, apart
from marey.motion.rigs.rigged import RiggedMotion

CENTIMETRE = 0.01


def format_rigged_fbx(motion: RiggedMotion) -> bytes:
    """Return the bytes of an FBX file; equal motions give equal bytes.

    A rig of an FBX file keeps its unit, its upward axis and the scales of its nodes. Rigs of other formats are written in
    centimetres, Y up, without scales: their joints keep names, axes and places.

    Raises:
        InvalidInput: numbers that are not finite.
    """
    document = Document()
    poses = _as_in_file(motion) if motion.rig.source == "fbx" else _in_centimetres(motion)
    add_motion(document, poses)
    return document.encode(fps=poses.fps, frames=len(poses.rotations), unit=poses.unit, up=poses.up)


def _as_in_file(motion: RiggedMotion) -> FbxPoses:
    rig = motion.rig
    turns, places = rig.in_file(rig.local_rotations, rig.offsets)
    rotations, translations = rig.in_file(motion.rotations, motion.translations)
    joints = np.flatnonzero(motion.moving).tolist()
    return FbxPoses(
        names=rig.joint_names,
        parents=rig.parents,
        places=apart(places, rig.parents, joints, 1 / rig.unit),
        turns=turns,
        rotations=rotations,
        moving={joint: translations[:, joint] for joint in joints},
        fps=motion.fps,
        unit=rig.unit,
        up=rig.up,
        limbs=rig.bones,
        scales=rig.scales / rig.parent_scales,
    )


def _in_centimetres(motion: RiggedMotion) -> FbxPoses:
    rig = motion.rig
    joints = np.flatnonzero(motion.moving).tolist()
    return FbxPoses(
        names=rig.joint_names,
        parents=rig.parents,
        places=apart(rig.offsets / CENTIMETRE, rig.parents, joints, 1 / CENTIMETRE),
        turns=rig.local_rotations,
        rotations=motion.rotations,
        moving={joint: motion.translations[:, joint] / CENTIMETRE for joint in joints},
        fps=motion.fps,
        unit=CENTIMETRE,
        limbs=rig.bones,
    )
