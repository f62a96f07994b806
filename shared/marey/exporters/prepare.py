"""Steps that formats with a skeleton share before they write a clip: its rest pose, and a body on request."""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.exporters.exporter import Coordinates

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.io.bvh import BvhClip
    from marey.motion.io.mesh import Mesh


def in_rest_pose(clip: MotionClip | BvhClip, coordinates: Coordinates) -> MotionClip | BvhClip:
    """Return a clip, which is in the T-pose, in the rest pose of the coordinates.

    Raises:
        InvalidInput: the skeleton has no such rest pose.
    """
    if coordinates.rest_pose == "t":
        return clip
    from marey.motion.rest_pose import change_rest_pose

    return change_rest_pose(clip, coordinates.rest_pose)


def with_body(clip: MotionClip | BvhClip, coordinates: Coordinates) -> tuple[MotionClip | BvhClip, Mesh | None]:
    """Return a clip in the rest pose of the coordinates, and the body of its skeleton, None if they ask for none.

    Raises:
        InvalidInput: the skeleton has no such rest pose.
    """
    clip = in_rest_pose(clip, coordinates)
    if not coordinates.mesh:
        return clip, None
    from marey.motion.io.convert import as_motion_clip
    from marey.viz.mannequin import mannequin

    clip = as_motion_clip(clip)
    return clip, mannequin(clip)
