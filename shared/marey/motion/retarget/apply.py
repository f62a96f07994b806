"""Put a clip on a rig as the options of an export say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.arrange import moved
from marey.motion.clip import MotionClip
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.retarget.cycles import played_around
from marey.motion.retarget.load import load_body
from marey.motion.retarget.posed import local_poses
from marey.motion.retarget.retarget import retarget
from marey.motion.retarget.source import source_of
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Array, multiply, rotate


def put_on_rig(clip: MotionClip, options: ExportOptions, body: RigBody | None = None) -> RiggedMotion:
    """Put a clip on the rig that the options name.

    Args:
        body: that rig; None = load it.

    Raises:
        InvalidInput: the rig is unknown, has no legs or the wrong size, has no bone for `root_bone`, or the clip has
            bones that change their length.
        NotFound, InvalidFile, TooLarge: the file of the rig or of the map cannot be read.
    """
    assert options.rig is not None
    return on_body(clip, body or load_body(options.rig, options.rig_map), options)


def on_body(clip: MotionClip, body: RigBody, options: ExportOptions = PLAIN, *, hands: bool = False) -> RiggedMotion:
    """Put a clip on a rig.

    Args:
        options: `root_bone`, `in_place`, `tpose_frame` and `placement` act on the motion.
        hands: bring the hands where the clip's hands are, see `retarget`.

    Raises:
        InvalidInput: the rig has no bone for `root_bone`, the clip has bones that change their length, or the record of
            a loop in its manifest cannot be read.
    """
    rotations, root, heading, removed = moved(clip, options)
    clip = MotionClip.of(clip.skeleton, rotations, root, clip.contacts, clip.fps, manifest=clip.manifest)
    longer, own = played_around(clip, options)
    motion = retarget(source_of(longer), body, hands=hands)
    motion = replace(
        motion,
        rotations=motion.rotations[own],
        translations=motion.translations[own],
        contacts=motion.contacts[own],
        removed=removed,
    )
    if options.root_bone:
        motion = _on_root(motion, body, heading)
    return _with_rest_frame(motion) if options.tpose_frame else motion


def _on_root(motion: RiggedMotion, body: RigBody, heading: Array) -> RiggedMotion:
    """Return the motion with X, Z and heading of the hips on the bone over them, which takes along what hangs on it but
    for the body and what follows it."""
    rig, root, hips = motion.rig, body.map.root, body.map.parts["hips"]
    if root is None:
        raise InvalidInput(
            "the rig has no bone above the hips that could carry the travel",
            where=rig.name,
            hint="Leave out root_bone, or add a root bone to the rig.",
            argument="root_bone",
        )
    turns, places = motion.world()
    floor = np.array([1.0, 0.0, 1.0])
    own = {hips, *body.map.follows}
    carried: set[int] = set()
    for joint, parent in enumerate(rig.parents):
        if joint == root:
            turns[:, root] = multiply(np.broadcast_to(heading, (motion.frames, 4)), rig.orientations[root])
            places[:, root] = rig.positions[root] + (places[:, hips] - rig.positions[hips]) * floor
            carried.add(joint)
        elif parent in carried and joint not in own:
            places[:, joint] = places[:, parent] + rotate(turns[:, parent], rig.offsets[joint])
            turns[:, joint] = multiply(turns[:, parent], rig.local_rotations[joint])
            carried.add(joint)
    rotations, translations, moving = local_poses(rig, turns, places)
    return replace(motion, rotations=rotations, translations=translations, moving=moving)


def _with_rest_frame(motion: RiggedMotion) -> RiggedMotion:
    """Return the motion with the rig's rest pose before it."""
    rig = motion.rig
    return replace(
        motion,
        rotations=np.concatenate([rig.local_rotations[None], motion.rotations]),
        translations=np.concatenate([rig.offsets[None], motion.translations]),
        contacts=np.concatenate([np.zeros((1, 4), bool), motion.contacts]),
    )
