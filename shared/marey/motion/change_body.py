"""A finished motion on a body of other proportions, as `marey generate --body` gives it: joints keep their rotations,
travel is scaled by the length of the legs, standing feet are locked, and hands that meet get their distance again."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from marey.core.errors import InvalidInput
from marey.motion.body import NamedBody, travel_scale
from marey.motion.body_files import read_body
from marey.motion.clip import QUALITY, MotionClip
from marey.motion.feet import clean_feet, find_contacts
from marey.motion.files import stamp_of
from marey.motion.finish import CLEANED
from marey.motion.hands import join_hands, wrist_distance
from marey.motion.kinematics import forward_kinematics
from marey.motion.pose import aim_bones
from marey.motion.skeleton import HUMANML3D


def load_shape(given: str | Path, rig_map: str | Path | None = None) -> NamedBody:
    """Return the body `standard`, or that of a rig or an npz file, for motions of 22 joints. A file is read again when
    it changes.

    Raises:
        NotFound, InvalidFile, InvalidInput, TooLarge: see `read_body`.
    """
    return _load(str(given), stamp_of(given), None if rig_map is None else str(rig_map), stamp_of(rig_map))


def change_body(clip: MotionClip, body: NamedBody) -> MotionClip:
    """Return a motion on another body, without features and without a record of quality; a motion that has the body
    already is returned as it is.

    Args:
        clip: on the skeleton of 22 joints; its feet are locked unless its manifest says that they were not.
        body: the skeleton to put it on.

    Raises:
        InvalidInput: the clip has another skeleton.
    """
    own, skeleton = clip.skeleton, body.skeleton
    if own.name != HUMANML3D.name:
        raise InvalidInput(
            f"bodies fit motions on {HUMANML3D.name}; this one is on {own.name}",
            where="body",
            hint="Leave out the body, or put the motion on a rig.",
            argument="body",
        )
    if (own.offsets[1:] == skeleton.offsets[1:]).all():
        return clip
    scale = travel_scale(own, skeleton)
    rotations = clip.rotations.astype("float64")
    root = scale * clip.root.astype("float64")
    joints = forward_kinematics(skeleton, rotations, root)
    if not clip.manifest.get(CLEANED, True):
        contacts = find_contacts(joints, skeleton, clip.fps)
    else:
        joints, contacts = clean_feet(joints, skeleton, clip.fps)
        joints = join_hands(joints, scale * wrist_distance(clip.joints.astype("float64"), own), skeleton)
        rotations, root = aim_bones(joints, rotations, skeleton), joints[:, 0]
    manifest = {name: value for name, value in clip.manifest.items() if name != QUALITY} | {"body": body.describe()}
    return MotionClip.of(skeleton, rotations, root, contacts, clip.fps, manifest=manifest)


@lru_cache(maxsize=16)
def _load(given: str, stamp: tuple[int, int], rig_map: str | None, map_stamp: tuple[int, int]) -> NamedBody:
    return read_body(given, HUMANML3D, rig_map)
