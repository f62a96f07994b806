"""Write motions on a rig as FBX: the rig's hierarchy, names, joint axes and rest pose."""

from __future__ import annotations

from marey.motion.io.fbx_document import FbxDocument
from marey.motion.io.fbx_write import add_motion, off_parent_axis
from marey.motion.io.file_poses import rigged_poses
from marey.motion.rigs.rigged import RiggedMotion


def format_rigged_fbx(motion: RiggedMotion) -> bytes:
    """Return the bytes of an FBX file; equal motions give equal bytes. See `rigged_poses` for unit and axes.

    Raises:
        InvalidInput: numbers that are not finite.
    """
    document, poses = FbxDocument(), off_parent_axis(rigged_poses(motion, "fbx"))
    add_motion(document, poses)
    return document.encode(fps=poses.fps, frames=len(poses.rotations), unit=poses.unit, up=poses.up)
